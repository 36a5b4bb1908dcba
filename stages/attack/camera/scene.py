"""What a bag knows of an image: how far its pixels are, whose they are, and where road users stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import RecordedCamera, camera_lens
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.build import stamp_ns as header_stamp_ns
from advpipe.pipeline.messages.compressed_image import image_from_cdr, pixels_of
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.pipeline.sensors.camera.lens import Fisheye, Lens


@dataclass(frozen=True)
class CameraScene:
    """One image's pixels and the road users around it.

    range_m: (H, W) float64, along the ray of each pixel; NaN where it is unknown. tags: (H, W) uint8,
    CARLA's. users: (H, W) int32, index into `ids`, -1 for none. boxes: in the vehicle's frame, x forward and
    z up. base_SE3_optical, map_SE3_base: (4, 4).
    """

    lens: Lens
    range_m: Float64
    tags: npt.NDArray[np.uint8]
    users: npt.NDArray[np.int32]
    ids: tuple[str, ...]
    boxes: Boxes
    base_SE3_optical: Float64
    map_SE3_base: Float64

    def pixels_of(self, road_user: str) -> npt.NDArray[np.bool_]:
        """Where (H, W) a road user is visible."""
        if road_user not in self.ids:
            return np.zeros(self.users.shape, np.bool_)
        found: npt.NDArray[np.bool_] = self.users == self.ids.index(road_user)
        return found

    def box_of(self, road_user: str) -> Float64 | None:
        """The true box (7,) of a road user in the vehicle's frame; None where there is none."""
        if road_user not in self.boxes.ids:
            return None
        box: Float64 = self.boxes.geometry[self.boxes.ids.index(road_user)]
        return box


class CameraSceneReader:
    """Looks up the scenes of one camera, asked for in time order. topic_names: of the messages to `take`.

    Raises AdvpipeError for a bag without depth, instances or the true boxes of road users.
    """

    def __init__(self, reader: BagReader, camera: RecordedCamera) -> None:
        topics = VehicleTopics(camera.vehicle)
        self._reader, self._topics = reader, topics
        self._depth = topics.camera_image(camera.name, "depth").name
        self._instances = topics.camera_image(camera.name, "instance_segmentation").name
        self._names = topics.instance_names(camera.name).name
        for name in (self._depth, self._instances, self._names):
            if name not in reader.topics:
                raise UsageError(
                    f"{reader.path} has no {name}; record the camera with "
                    "images: [rgb, depth, instance_segmentation]"
                )
        objects = objects_topic(reader, topics)
        if objects is None:
            raise UsageError(
                f"{reader.path} has no true boxes of road users; record the drive with a LiDAR on "
                f"{camera.vehicle}"
            )
        self._lens, self._truth = camera_lens(reader, camera), GroundTruth(reader, topics, objects)
        own = (self._depth, self._instances, self._names)
        self.topic_names = frozenset((*own, *self._truth.topic_names)) & reader.topics.keys()
        self._taken: dict[str, RawMessage] = {}
        width, height = self._lens.size_px
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        rays = self._lens.directions(np.column_stack([x.ravel(), y.ravel()]))
        is_fisheye = isinstance(self._lens, Fisheye)
        self._per_depth = (np.ones(len(rays)) if is_fisheye else 1 / rays[:, 2]).reshape(height, width)

    def take(self, raw: RawMessage) -> None:
        """Keep what a message of `topic_names` says."""
        if raw.topic.name in self._truth.topic_names:
            self._truth.take(raw)
        elif raw.topic.name in self.topic_names:
            self._taken[raw.topic.name] = raw

    def scene(self, stamp_ns: int, frame_id: str) -> CameraScene:
        """The scene of an image; all messages of its instant were taken before.

        frame_id: the camera's optical frame. Raises AdvpipeError where they lack its depth, instances, boxes
        or transforms.
        """
        depth_mm, seen = self._image(self._depth, stamp_ns), self._image(self._instances, stamp_ns)
        shape = self._per_depth.shape
        if depth_mm.shape != shape or seen.shape != (*shape, 3):
            raise AdvpipeError(f"{self._reader.path}: depth or instances have another size than the camera")
        names = self._reader.decode(self._raw(self._names, stamp_ns))
        numbers = seen[..., 1].astype(np.int32) + 256 * seen[..., 2].astype(np.int32)
        known = {int(each.class_id): index for index, each in enumerate(names.class_map)}
        table = np.full(1 << 16, -1, np.int32)
        for number, index in known.items():
            table[number & 0xFFFF] = index
        base = self._topics.base_frame
        return CameraScene(
            self._lens,
            np.where(depth_mm > 0, depth_mm * self._per_depth / 1000, np.nan),
            np.ascontiguousarray(seen[..., 0]),
            table[numbers],
            tuple(each.class_name for each in names.class_map),
            self._truth.boxes(stamp_ns, base),
            self._truth.lidar_SE3(frame_id, stamp_ns, base),
            self._truth.lidar_SE3(base, stamp_ns, MAP_FRAME),
        )

    def _raw(self, topic: str, stamp_ns: int) -> RawMessage:
        raw = self._taken.get(topic)
        if raw is None or header_stamp_ns(self._reader.decode(raw)) != stamp_ns:
            raise AdvpipeError(f"{self._reader.path}: no message of {topic} has the stamp {stamp_ns} ns")
        return raw

    def _image(self, topic: str, stamp_ns: int) -> npt.NDArray[np.uint16]:
        image = image_from_cdr(self._raw(topic, stamp_ns).cdr)
        found: npt.NDArray[np.uint16] = pixels_of(image.file)
        return found
