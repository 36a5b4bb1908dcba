"""The boxes of the road users at the instant of a cloud, in the LiDAR's frame."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator
from typing import Any

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.labels import IgnoredBoxes, coverage_from_message
from advpipe.pipeline.messages.topics import TF, TF_STATIC, VehicleTopics, is_truth

LATENCY_NS = 500_000_000
"""How far apart another tool's recorder may have logged a cloud and the truth with the same stamp."""

CLASS_ALIASES = {
    "van": "truck",
    "bus": "truck",
    "motorcycle": "cyclist",
    "motorcyclist": "cyclist",
    "bicycle": "cyclist",
    "person": "pedestrian",
}
"""Other names of the classes, in lower case."""

BOX_TYPES = ("vision_msgs/msg/Detection3DArray", "derived_object_msgs/msg/ObjectArray")
"""3D boxes that are read; where a bag has both, the first."""

OBJECT_CLASSES = {4: "pedestrian", 5: "bicycle", 6: "car", 7: "truck", 8: "motorcycle"}
"""Road users by the `classification` of derived_object_msgs/Object; the rest are signs, barriers, unknown."""

SOLID_BOX = 1
"""shape_msgs/SolidPrimitive.BOX"""


def objects_topic(reader: BagReader, topics: VehicleTopics) -> str | None:
    """The topic with the boxes: the vehicle's own, or the bag's only one of a type; None without any."""
    by_type = ([name for name in reader.topics_of_type(each) if is_truth(name)] for each in BOX_TYPES)
    candidates: list[str] = next(filter(None, by_type), [])
    if topics.objects.name in candidates:
        return topics.objects.name
    if len(candidates) > 1:
        raise UsageError(
            f"{reader.path} has several topics of boxes ({', '.join(candidates)}) and none of them is "
            f"{topics.objects.name}; rename or remove all but one"
        )
    return candidates[0] if candidates else None


class GroundTruth:
    """Looks up the boxes for clouds asked for in time order; memory holds about a second of the bag.

    topic_names: of the messages to `take`.
    """

    def __init__(self, reader: BagReader, topics: VehicleTopics, objects: str) -> None:
        self._reader, self._topics, self._objects = reader, topics, objects
        self._static = _static_transforms(reader)
        self._boxes: dict[int, tuple[str, Boxes]] = {}
        self._velocities: dict[int, dict[str, Float64]] = {}
        self._moving: dict[int, dict[str, tuple[str, Float64]]] = {}
        self._ignored: dict[int, tuple[str, IgnoredBoxes]] = {}
        self._coverage: dict[int, tuple[str, LabelCoverage]] = {}
        self.topic_names = (
            objects,
            topics.road_users.name,
            topics.true_odometry.name,
            TF.name,
            topics.ignored_objects.name,
            topics.label_coverage.name,
        )

    @property
    def stamps_ns(self) -> Container[int]:
        """The header stamps of the boxes that it remembers."""
        return self._boxes.keys()

    def boxes(self, stamp_ns: int, lidar_frame: str) -> Boxes:
        """The boxes with this header stamp, in the LiDAR's frame; all their messages were taken before."""
        self.forget_before(stamp_ns)
        if stamp_ns not in self._boxes:
            raise AdvpipeError(self._without_boxes(stamp_ns))
        frame_id, boxes = self._boxes[stamp_ns]
        known = self._velocities.get(stamp_ns, {})
        unknown = np.full(3, np.nan)
        velocity_mps = np.array([known.get(name, unknown) for name in boxes.ids]).reshape(-1, 3)
        boxes = Boxes(boxes.geometry, boxes.labels, boxes.ids, velocity_mps)
        if frame_id == lidar_frame:
            return boxes
        return boxes.transformed(self.lidar_SE3(frame_id, stamp_ns, lidar_frame))

    def coverage(self, stamp_ns: int, lidar_frame: str) -> LabelCoverage:
        """Where objects are labelled at this stamp, in the LiDAR's frame; everywhere, if nothing says."""
        frame_id, coverage = self._coverage.get(stamp_ns, (lidar_frame, LabelCoverage()))
        if frame_id == lidar_frame:
            return coverage
        return coverage.transformed(self.lidar_SE3(frame_id, stamp_ns, lidar_frame))

    def ignored(self, stamp_ns: int, lidar_frame: str) -> IgnoredBoxes:
        """The objects with this stamp that count neither way, in the LiDAR's frame."""
        frame_id, ignored = self._ignored.get(stamp_ns, (lidar_frame, IgnoredBoxes()))
        if frame_id == lidar_frame:
            return ignored
        return ignored.transformed(self.lidar_SE3(frame_id, stamp_ns, lidar_frame))

    def _without_boxes(self, stamp_ns: int) -> str:
        """What is wrong where no boxes have a cloud's stamp: they are stamped otherwise, or missing."""
        wrong = f"{self._reader.path}: no message of {self._objects} has the stamp {stamp_ns} ns of a cloud"
        first_ns, last_ns = max(0, stamp_ns - LATENCY_NS), stamp_ns + LATENCY_NS
        near = map(self._reader.decode, self._reader.raw_messages([self._objects], first_ns, last_ns))
        offsets_ns = [other_ns - stamp_ns for other_ns in (*self._boxes, *map(build.stamp_ns, near))]
        if not offsets_ns:
            fix = option_name("frames", "start:stop:step")
            return f"{wrong}, nor one near it; choose frames with ground truth ({fix})"
        nearest_ns = min(offsets_ns, key=abs)
        side = "later" if nearest_ns > 0 else "earlier"
        return (
            f"{wrong}: the nearest is {abs(nearest_ns) / 1e6:g} ms {side}; give the boxes of each cloud the "
            "cloud's header stamp, or choose frames where they have it "
            f"({option_name('frames', 'start:stop:step')})"
        )

    def take(self, raw: RawMessage) -> None:
        """Keeps what a message of `topic_names` says."""
        message = self._reader.decode(raw)
        name = raw.topic.name
        if name == self._topics.ignored_objects.name:
            self._ignored[build.stamp_ns(message)] = (message.header.frame_id, _ignored_boxes(message))
        elif name == self._topics.label_coverage.name:
            coverage = coverage_from_message(message)
            self._coverage[build.stamp_ns(message)] = (message.header.frame_id, coverage)
        elif name == self._objects:
            boxes = self._boxes_of(message)
            self._boxes[build.stamp_ns(message)] = (message.header.frame_id, boxes)
        elif name == self._topics.road_users.name:
            self._velocities[build.stamp_ns(message)] = {
                user.id: np.array([user.velocity.x, user.velocity.y, user.velocity.z])
                for user in message.road_users
            }
        elif name == self._topics.true_odometry.name:
            moving = self._moving.setdefault(build.stamp_ns(message), {})
            pose = build.se3_from_pose(message.pose.pose)
            moving[message.child_frame_id] = (message.header.frame_id, pose)
        else:
            for transform in message.transforms:
                moving = self._moving.setdefault(build.stamp_ns(transform), {})
                # The true pose wins over an estimate on /tf.
                moving.setdefault(transform.child_frame_id, _parent_and_pose(transform))

    def forget_before(self, stamp_ns: int) -> None:
        """Forget what no cloud from this stamp on needs."""
        for by_stamp in self._by_stamp:
            for old in [stamp for stamp in by_stamp if stamp < stamp_ns - LATENCY_NS]:
                del by_stamp[old]

    def forget(self) -> None:
        """Forget all stamps, such as before a cloud is asked for that lies before the last one."""
        for by_stamp in self._by_stamp:
            by_stamp.clear()

    @property
    def _by_stamp(self) -> tuple[dict[int, Any], ...]:
        return self._boxes, self._velocities, self._moving, self._ignored, self._coverage

    def lidar_SE3(self, frame_id: str, stamp_ns: int, lidar_frame: str) -> Float64:
        """`lidar_SE3_frame`, through the tree of transforms at that instant."""
        parents = {**self._moving.get(stamp_ns, {}), **self._static}
        lidar_root, root_SE3_lidar = _to_root(parents, lidar_frame)
        frame_root, root_SE3_frame = _to_root(parents, frame_id)
        if lidar_root != frame_root:
            raise AdvpipeError(
                f"{self._reader.path}: no transform connects the frame {frame_id!r} of {self._objects} to "
                f"{lidar_frame!r} at {stamp_ns} ns; record {self._transform_topics()} with one, stamped like "
                f"each cloud, or give the boxes in the frame {lidar_frame!r}"
            )
        return invert(root_SE3_lidar) @ root_SE3_frame

    def mount(self, base_frame: str, sensor_frame: str) -> Float64 | None:
        """`base_SE3_sensor` as /tf_static has it, the same at all instants; None where it does not."""
        frame_id, frame_SE3_sensor = sensor_frame, np.eye(4)
        for _ in range(len(self._static) + 1):
            if frame_id == base_frame:
                return frame_SE3_sensor
            if frame_id not in self._static:
                break
            frame_id, parent_SE3_child = self._static[frame_id]
            frame_SE3_sensor = parent_SE3_child @ frame_SE3_sensor
        return None

    def _transform_topics(self) -> str:
        """The topics that may tie boxes and clouds: of odometry only one that the bag has."""
        odometry = self._topics.true_odometry.name
        names = [TF_STATIC.name, TF.name, *([odometry] if odometry in self._reader.topics else [])]
        return f"{', '.join(names[:-1])} or {names[-1]}"

    def _boxes_of(self, message: Any) -> Boxes:
        of_objects = hasattr(message, "objects")
        objects = list(_objects(message) if of_objects else _detections(message))
        for name, _, _, size_m in objects:
            if len(size_m) != 3:
                raise AdvpipeError(
                    f"{self._reader.path}: {self._objects} has {name!r}, whose shape is not a box"
                )
        labels = np.array([self._label_of(class_name) for _, class_name, _, _ in objects], np.int64)
        ids = tuple(name for name, _, _, _ in objects)
        return Boxes(_geometry(objects), labels, ids, np.full((len(ids), 3), np.nan))

    def _label_of(self, name: str) -> int:
        known = CLASS_ALIASES.get(name.lower(), name.lower())
        if known not in CLASSES:
            raise AdvpipeError(
                f"{self._reader.path}: {self._objects} has the class {name!r}; known are "
                f"{', '.join((*CLASSES, *CLASS_ALIASES))}"
            )
        return CLASSES.index(known)


Named = tuple[str, str, Any, tuple[float, ...]]
"""Id, class, pose of the centre, and length, width and height in metres."""


def _geometry(objects: Iterable[Named]) -> Float64:
    """The boxes (M, 7) of objects that are boxes."""
    rows = [
        (centre.position.x, centre.position.y, centre.position.z, *size_m, _yaw(centre.orientation))
        for _, _, centre, size_m in objects
    ]
    return np.array(rows, np.float64).reshape(-1, 7)


def _ignored_boxes(message: Any) -> IgnoredBoxes:
    """The boxes of a vision_msgs/Detection3DArray, with the source's names of their classes."""
    objects = list(_detections(message))
    class_names, ids = tuple(each[1] for each in objects), tuple(each[0] for each in objects)
    return IgnoredBoxes(_geometry(objects), class_names, ids)


def _detections(message: Any) -> Iterator[Named]:
    """The boxes of a vision_msgs/Detection3DArray."""
    for each in message.detections:
        results = [result.hypothesis for result in each.results]
        class_name = max(results, key=lambda result: result.score).class_id if results else ""
        size = each.bbox.size
        yield each.id, class_name, each.bbox.center, (size.x, size.y, size.z)


def _objects(message: Any) -> Iterator[Named]:
    """The road users of a derived_object_msgs/ObjectArray; what is no box has no size."""
    for each in message.objects:
        if each.classification in OBJECT_CLASSES:
            size_m = tuple(map(float, each.shape.dimensions)) if each.shape.type == SOLID_BOX else ()
            yield str(each.id), OBJECT_CLASSES[each.classification], each.pose, size_m


def _yaw(quaternion: Any) -> float:
    """The heading in radians, as `yaw_of` its rotation matrix; a box has thousands of siblings."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _static_transforms(reader: BagReader) -> dict[str, tuple[str, Float64]]:
    """Parent frame and parent_SE3_child of each static child frame."""
    if TF_STATIC.name not in reader.topics:
        return {}
    return {
        transform.child_frame_id: _parent_and_pose(transform)
        for _, message in reader.messages(TF_STATIC.name)
        for transform in message.transforms
    }


def _parent_and_pose(transform: Any) -> tuple[str, Float64]:
    return transform.header.frame_id, build.se3_from_transform(transform.transform)


def _to_root(parents: dict[str, tuple[str, Float64]], frame_id: str) -> tuple[str, Float64]:
    """The root above a frame, and root_SE3_frame."""
    root_SE3_frame = np.eye(4)
    for _ in range(len(parents) + 1):  # a tree has no longer path; a loop ends here
        if frame_id not in parents:
            break
        frame_id, parent_SE3_child = parents[frame_id]
        root_SE3_frame = parent_SE3_child @ root_SE3_frame
    return frame_id, root_SE3_frame
