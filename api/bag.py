"""A recorded drive as arrays: clouds with their boxes, CAMs, GPS fixes, and any message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.commands.paths import PathLike
from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles, recorded_receptions
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.mcap.channel import TopicInfo
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_SENT, VehicleTopics
from advpipe.pipeline.replay.recorded_filter import vehicles_with_gnss
from advpipe.pipeline.v2x.facilities.cam_values import PLAIN, QUANTITIES, values_of_payload

CAM_DTYPE = np.dtype(
    [
        ("stamp_ns", "i8"),
        *((name, "i8") for name in PLAIN),
        *((name, "f8") for name in QUANTITIES),
    ]
)
"""The values of a vehicle's CAM; NaN for those that it omits or marks as unavailable."""

RECEIVED_CAM_DTYPE = np.dtype([*CAM_DTYPE.descr, ("power_dbm", "f8"), ("sinr_db", "f8"), ("number", "i8")])
"""The same for a received CAM, with its power and SINR, and the number of the sent message that it truly was:
ground truth, by which `v2x_labels.parquet` names messages too. NaN and -1 where the bag does not record them.
"""

FIX_DTYPE = np.dtype(
    [("stamp_ns", "i8"), ("latitude_deg", "f8"), ("longitude_deg", "f8"), ("altitude_m", "f8")]
)
"""A GPS fix in WGS 84; NaN where the receiver has none."""

Table = npt.NDArray[np.void]


def open_bag(path: PathLike) -> Bag:
    """Opens a data set's clean bag, a rosbag2 folder, an .mcap file or what an earlier command made.

    Raises UsageError for a path that is none of them, and AdvpipeError for a damaged bag.

    >>> bag = advpipe.open_bag("datasets/smoke")
    >>> frame = bag.frame(0)
    >>> frame.cloud["z"].mean(), frame.boxes.geometry.shape
    """
    with as_usage_error():
        return Bag(resolve_bag(Path(path)))


class Bag:
    """A recorded drive. No file stays open between calls, and frames are read one at a time.

    All stamps are nanoseconds since 1970. Damaged parts raise AdvpipeError, one line with the file's name,
    when they are read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader = BagReader(path)

    def __repr__(self) -> str:
        return f"<Bag {self.path}: {len(self.topics)} topics>"

    @property
    def topics(self) -> Mapping[str, TopicInfo]:
        """Type, quality of service and number of messages of each topic, by its name."""
        return self._reader.topics

    @property
    def provenance(self) -> Mapping[str, str]:
        """How the bag was made: scenario, seed, versions, and the attack if there was one; empty for another
        tool's bag."""
        return self._reader.provenance

    def frames(self, frames: str = "::", *, lidar: str | None = None) -> Iterator[Frame]:
        """Each chosen cloud with the road users around it, in the order of time.

        frames: `start:stop:step`. lidar: the topic of the clouds, among several. A frame has an `index`, a
        `stamp_ns`, a `cloud` (N,) with the fields x, y, z in metres, intensity, ring and time in seconds,
        and `boxes` in the LiDAR's frame: `geometry` (M, 7) with the columns of `BOX_COLUMNS`, `labels` (M,)
        that index `CLASSES`, `ids` and `velocity_mps` (M, 3). Boxes are empty in a bag without truth.

        Raises UsageError for a bag without clouds and for frames that it does not have.
        """
        with as_usage_error():
            chosen = FrameSlice.parse(frames)
        return read_frames(self.path, chosen, lidar_topic=lidar)

    def frame(self, index: int, *, lidar: str | None = None) -> Frame:
        """One frame by its index, from 0; see `frames`."""
        return next(self.frames(f"{index}:{index + 1}", lidar=lidar))

    def cams(self, vehicle: str = "ego") -> Table:
        """The CAMs that a vehicle received, by arrival (K,): a structured array of `RECEIVED_CAM_DTYPE`.

        stamp_ns: of the arrival. Messages that are not a vehicle's CAM are left out. Raises UsageError for a
        vehicle that received nothing.
        """
        known = receiving_vehicles(self._reader)
        if vehicle not in known:
            raise UsageError(
                f"{self.path}: {vehicle} receives no CAMs; {known_names(vehicle, known, 'vehicles that do')}"
            )
        rows = [
            (*cam, each.power_dbm, each.sinr_db, -1 if each.number is None else each.number)
            for each in recorded_receptions(self._reader, vehicle)
            if each.payload is not None and (cam := _cam(each.arrival_ns, each.payload))
        ]
        return np.array(rows, RECEIVED_CAM_DTYPE)

    def sent_cams(self) -> Table:
        """The CAMs that all vehicles sent, whoever received them (K,): a structured array of `CAM_DTYPE`.

        stamp_ns: when the sender handed it to its radio. Raises UsageError for a bag without V2X.
        """
        sent = (message for _, message in self._reader.messages(V2X_SENT.name))
        cams = (_cam(build.stamp_ns(each), bytes(each.payload)) for each in sent)
        return np.array([cam for cam in cams if cam], CAM_DTYPE)

    def fixes(self, vehicle: str = "ego") -> Table:
        """The GPS fixes of a vehicle (K,): a structured array of `FIX_DTYPE`.

        Raises UsageError for a vehicle without any.
        """
        known = vehicles_with_gnss(self._reader)
        if vehicle not in known:
            raise UsageError(
                f"{self.path}: {vehicle} has no GPS; {known_names(vehicle, known, 'vehicles that do')}"
            )
        rows = [
            (build.stamp_ns(fix), *_place(fix))
            for _, fix in self._reader.messages(VehicleTopics(vehicle).gnss_fix.name)
        ]
        return np.array(rows, FIX_DTYPE)

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Log time in nanoseconds and decoded message of one topic, whatever it is, in the order of time.

        A message has the fields of its ROS type as the bag defines it. Raises UsageError for a topic that the
        bag does not have.
        """
        return self._reader.messages(topic)


def _cam(stamp_ns: int, payload: bytes) -> tuple[float, ...] | None:
    """The columns of `CAM_DTYPE`; None for a message that is not a vehicle's CAM."""
    values = values_of_payload(payload)
    if values is None:
        return None
    return (stamp_ns, *(values[name] for name in PLAIN), *(_number(values[name]) for name in QUANTITIES))


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def _place(fix: Any) -> Sequence[float]:
    """Latitude, longitude and altitude."""
    return (fix.latitude, fix.longitude, fix.altitude) if fix.status.status >= 0 else (np.nan,) * 3
