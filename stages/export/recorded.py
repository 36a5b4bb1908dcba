"""The clouds of a bag with what is known about them in the map's frame, as forms with poses write them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import read_clouds, refuse_without_ground_truth, vehicle_topics
from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.geometry.boxes import Boxes, count_points
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.pipeline.messages.topics import MAP_FRAME


@dataclass(frozen=True)
class RecordedFrame:
    """One cloud, in the LiDAR's frame; boxes and what is ignored, in the map's.

    lidar_points: (M,) points of the cloud in each box. has_pose: False where the bag does not say where the
    vehicle is: then the map's frame is that of the vehicle.
    """

    stamp_ns: int
    cloud: Cloud
    boxes: Boxes
    ignored: IgnoredBoxes
    lidar_points: npt.NDArray[np.int64]
    ignored_lidar_points: npt.NDArray[np.int64]
    map_SE3_base: Float64
    base_SE3_lidar: Float64
    has_pose: bool
    covers_view_only: bool

    @property
    def map_SE3_lidar(self) -> Float64:
        """The LiDAR's pose."""
        return self.map_SE3_base @ self.base_SE3_lidar


def recorded_frames(
    bag: Path,
    lidar_topic: str,
    chosen: FrameSlice = ALL_FRAMES,
    only_stamps_ns: Container[int] | None = None,
) -> Iterator[RecordedFrame]:
    """The chosen frames of a LiDAR in time order, one in memory at a time.

    only_stamps_ns: leave out others. Raises UsageError for a bag without boxes.
    """
    refuse_without_ground_truth(bag, lidar_topic, fix="this form needs it; export the bag that holds it")
    base_frame = vehicle_topics(lidar_topic).base_frame
    for _, scan, truth in read_clouds(bag, chosen, lidar_topic=lidar_topic):
        if only_stamps_ns is not None and scan.stamp_ns not in only_stamps_ns:
            continue
        assert truth is not None  # refused above
        stamp_ns, lidar_frame = scan.stamp_ns, scan.frame_id
        base_SE3_lidar = truth.mount(base_frame, lidar_frame)
        if base_SE3_lidar is None:
            base_SE3_lidar = _pose(truth, stamp_ns, lidar_frame, base_frame)
        vehicle_frame = lidar_frame if base_SE3_lidar is None else base_frame
        map_SE3_base = _pose(truth, stamp_ns, vehicle_frame, MAP_FRAME)
        own_frame = vehicle_frame if map_SE3_base is None else MAP_FRAME
        yield RecordedFrame(
            stamp_ns,
            scan.cloud,
            truth.boxes(stamp_ns, own_frame),
            truth.ignored(stamp_ns, own_frame),
            count_points(xyz(scan.cloud), truth.boxes(stamp_ns, lidar_frame).geometry),
            count_points(xyz(scan.cloud), truth.ignored(stamp_ns, lidar_frame).geometry),
            np.eye(4) if map_SE3_base is None else map_SE3_base,
            np.eye(4) if base_SE3_lidar is None else base_SE3_lidar,
            map_SE3_base is not None,
            bool(truth.coverage(stamp_ns, lidar_frame).labelled),
        )


def drive_name(bags: Mapping[str, Path]) -> str:
    """The name of a data set's drive: its folder's, or that of a single bag."""
    name, bag = next(iter(bags.items()))
    return bag.resolve().parent.name if name == CLEAN_NAME else name


def _pose(truth: GroundTruth, stamp_ns: int, frame_b: str, frame_a: str) -> Float64 | None:
    """a_SE3_b; None where no transform says it."""
    try:
        return truth.lidar_SE3(frame_b, stamp_ns, frame_a)
    except AdvpipeError:
        return None
