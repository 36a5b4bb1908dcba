"""A recording of ROS as a drive: each cloud with the boxes nearest in time, and with the vehicle's pose."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64, invert, se3_from_yaw
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.named_boxes import NamedBox, sort_named_boxes
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.rosbag.clouds import cloud_of_message
from advpipe.stages.import_.rosbag.objects import PosedBox, boxes_of_message
from advpipe.stages.import_.rosbag.own_bag import (
    Uncounting,
    coverage_of,
    frame_names,
    ignored_boxes,
    source_of_bag,
)
from advpipe.stages.import_.rosbag.recording import Recorded, Recording
from advpipe.stages.import_.rosbag.topics import ChosenTopics
from advpipe.stages.import_.rosbag.transforms import LONGEST_GAP_NS, TransformTree

FARTHEST_LABEL_NS = 50_000_000
"""Between a cloud and the boxes that are taken for it."""

LATENCY_NS = 500_000_000
"""How much later than a cloud something of its instant may have been recorded."""

_MOST_WAITING = 50
_TRIED_CLOUDS = 50
"""How many clouds may pass until the recording has told where the LiDAR is mounted."""

_MOST_NAMED = 5
_EXPECTED = frozenset({CLOCK.name})
"""Topics that nobody misses: an import writes its own."""

_BASE_NAMES = ("base_link", "base_footprint")


@dataclass(frozen=True)
class Instant:
    """A cloud's message with its header, and what the recording says of its time.

    labels: the nearest message of boxes with its stamp; None where none is near. uncounting: what a bag of
    advpipe says of the same stamp.
    """

    stamp_ns: int
    frame_id: str
    recorded: Recorded
    message: Any
    labels: tuple[int, Any] | None
    uncounting: Uncounting


@dataclass(frozen=True)
class Mount:
    """base: the vehicle's frame; "" where the recording has none. base_SE3_lidar: where its LiDAR sits."""

    base: str
    base_SE3_lidar: Float64


class RecordedDrive:
    """An opened recording; see `DriveSource`."""

    are_related = True

    def __init__(
        self, recording: Recording, topics: ChosenTopics, options: ImportOptions, classes: Mapping[str, str]
    ) -> None:
        self._recording, self._topics, self._classes = recording, topics, classes
        self._chosen = options.classes
        self._scale = 1.0 if options.scale_intensity is None else options.scale_intensity
        self._on_ground = topics.objects is not None and topics.objects.startswith("/carla/")
        self.name = recording.path.resolve().stem
        self.frame_count = recording.topics[topics.points].messages
        source = source_of_bag(recording)
        self.licence, self.citation = source.licence, source.citation
        self._frame_names = frame_names(recording, topics)
        self._uncounting: dict[int, Uncounting] = {}
        self._static = self._read_static()
        self._mount = self._find_mount(options.lidar_height_m)
        self.notes: Sequence[str] = tuple(self._sentences(options.lidar_height_m))

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        return (("ego/base_link", "ego/lidar", self._mount.base_SE3_lidar),)

    @property
    def fingerprint(self) -> str:
        """Changes with the size or time of the recording."""
        status = self._recording.path.stat()
        return f"{status.st_size} {status.st_mtime_ns}" if self._recording.path.is_file() else ""

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """See `DriveSource.frames`."""
        tree = self._tree()
        for index, instant in enumerate(self._instants(tree, first), first):
            name = f"{self._recording.path}: {self._topics.points} {index}"
            try:
                source_name = self._frame_names.get(instant.recorded.log_time_ns, "")
                yield DriveFrame(name, instant.stamp_ns, {"ego": self._vehicle(tree, instant)}, source_name)
            except AdvpipeError as error:
                raise AdvpipeError(f"{name}: {error}") from None

    def class_names(self) -> Collection[str]:
        """The classes of all boxes, those that count neither way among them."""
        found: set[str] = set()
        topics = [name for name in (self._topics.objects, self._topics.ignored) if name is not None]
        for recorded in self._recording.messages(topics):
            boxes = boxes_of_message(self._recording.decode(recorded), recorded.type)
            found |= {each.class_name for each in boxes}
        return found

    def _vehicle(self, tree: TransformTree, instant: Instant) -> VehicleFrame:
        cloud = cloud_of_message(instant.message, instant.recorded.type, instant.stamp_ns, self._scale)
        boxes, ignored = self._boxes(tree, instant)
        return VehicleFrame(
            {"lidar": cloud},
            boxes,
            ignored=ignored,
            coverage=self._coverage(tree, instant),
            map_SE3_base=self._pose(tree, instant),
        )

    def _pose(self, tree: TransformTree, instant: Instant) -> Float64 | None:
        root = tree.root(instant.frame_id)
        if root in (instant.frame_id, self._mount.base):
            return None
        root_SE3_lidar = tree.lookup(root, instant.frame_id, instant.stamp_ns)
        return None if root_SE3_lidar is None else root_SE3_lidar @ invert(self._mount.base_SE3_lidar)

    def _boxes(self, tree: TransformTree, instant: Instant) -> tuple[Boxes | None, IgnoredBoxes]:
        if instant.labels is None or self._topics.objects is None:
            return None, IgnoredBoxes()
        label_ns, message = instant.labels
        later_s = (instant.stamp_ns - label_ns) / build.NS_PER_S
        posed = boxes_of_message(message, self._recording.topics[self._topics.objects].type)
        if self._on_ground:  # CARLA's bridge gives the vehicles' origins, which lie on the ground
            posed = [each if each.class_name == "pedestrian" else each.raised() for each in posed]
        named = [self._in_lidar(tree, instant, each, later_s) for each in posed]
        uncounted = self._ignored(tree, instant)
        named += [each for each in uncounted if each.class_name in self._chosen]
        kept = ignored_boxes([each for each in uncounted if each.class_name not in self._chosen])
        named = [each for each in named if not _is_around_origin(each)]
        boxes, ignored = sort_named_boxes(named, self._classes)
        return boxes, ignored.joined(kept)

    def _ignored(self, tree: TransformTree, instant: Instant) -> list[NamedBox]:
        """What a bag of advpipe says to count neither way."""
        if self._topics.ignored is None or instant.uncounting.ignored is None:
            return []
        type_name = self._recording.topics[self._topics.ignored].type
        posed = boxes_of_message(instant.uncounting.ignored, type_name)
        return [self._in_lidar(tree, instant, each, 0.0) for each in posed]

    def _coverage(self, tree: TransformTree, instant: Instant) -> LabelCoverage:
        message = instant.uncounting.coverage
        if message is None:
            return LabelCoverage()
        frame_id = str(message.header.frame_id).removeprefix("/") or instant.frame_id
        return coverage_of(message).transformed(self._lidar_SE3(tree, instant, frame_id))

    def _in_lidar(self, tree: TransformTree, instant: Instant, posed: PosedBox, later_s: float) -> NamedBox:
        frame_id = posed.frame_id or instant.frame_id
        return posed.in_frame(self._lidar_SE3(tree, instant, frame_id), later_s)

    def _lidar_SE3(self, tree: TransformTree, instant: Instant, frame_id: str) -> Float64:
        lidar_SE3_frame = tree.lookup(instant.frame_id, frame_id, instant.stamp_ns)
        if lidar_SE3_frame is None:
            raise AdvpipeError(
                f"no transform connects the frame {short_repr(frame_id)} of {self._topics.objects} to "
                f"{short_repr(instant.frame_id)} within {LONGEST_GAP_NS / 1e9:g} s; record /tf and "
                "/tf_static, or choose frames that have them (--frames)"
            )
        return lidar_SE3_frame

    def _read_static(self) -> list[tuple[str, str, Float64]]:
        static = []
        for recorded in self._recording.messages(self._topics.static_tf) if self._topics.static_tf else ():
            for each in self._recording.decode(recorded).transforms:
                pose = build.se3_from_transform(each.transform)
                static.append((each.header.frame_id, each.child_frame_id, pose))
        return static

    def _tree(self) -> TransformTree:
        tree = TransformTree(self._topics.has_true_odometry)
        for parent, child, parent_SE3_child in self._static:
            tree.add_static(parent, child, parent_SE3_child)
        return tree

    def _find_mount(self, height_m: float | None) -> Mount:
        """Where the LiDAR sits on the vehicle, as soon as the recording tells it."""
        tree = self._tree()
        mount = None
        for instant in islice(self._instants(tree, 0), _TRIED_CLOUDS):
            base = self._base_frame(tree, instant.frame_id)
            pose = tree.lookup(base, instant.frame_id, instant.stamp_ns) if base else None
            if base and pose is not None:
                mount = Mount(base, pose.copy())
                break
        if mount is None:
            return Mount("", se3_from_yaw((0.0, 0.0, height_m or 0.0), 0.0))
        if height_m is not None:
            mount.base_SE3_lidar[2, 3] = height_m
        return mount

    def _base_frame(self, tree: TransformTree, lidar_frame: str) -> str | None:
        """The vehicle's frame: by its name, by that of odometry, by the LiDAR's, or the lowest that moves."""
        frames = sorted(tree.frames)
        usual = [name for name in frames if name.rpartition("/")[2] in _BASE_NAMES]
        prefix = lidar_frame.removeprefix("/").rpartition("/")[0]
        root = tree.root(lidar_frame)
        own = [name for name in usual if prefix and name.startswith(f"{prefix}/")]
        for name in (*own, *usual, *sorted(tree.odometry_frames), prefix):
            if name and name in frames and tree.root(name) == root:
                return name
        return next((name for name in tree.chain(lidar_frame) if name in tree.moving_frames), None)

    def _instants(self, tree: TransformTree, first: int) -> Iterator[Instant]:
        """The clouds from an index on, each when all that belongs to it was read into the tree."""
        waiting: deque[Recorded] = deque()
        labels: deque[tuple[int, Any]] = deque(maxlen=1000)
        index = 0
        for recorded in self._recording.messages(self._topics.read):
            while waiting and (
                recorded.log_time_ns > waiting[0].log_time_ns + LATENCY_NS or len(waiting) >= _MOST_WAITING
            ):
                yield self._instant(tree, waiting.popleft(), labels)
            if recorded.topic == self._topics.points:
                if index >= first:
                    waiting.append(recorded)
                index += 1
            else:
                with self._usable(recorded):
                    self._take(tree, recorded, labels)
        while waiting:
            yield self._instant(tree, waiting.popleft(), labels)

    def _take(self, tree: TransformTree, recorded: Recorded, labels: deque[tuple[int, Any]]) -> None:
        message = self._recording.decode(recorded)
        if recorded.topic == self._topics.objects:
            labels.append((_stamp_ns(message, recorded), message))
        elif recorded.topic in (self._topics.ignored, self._topics.coverage):
            stamp_ns = _stamp_ns(message, recorded)
            known = self._uncounting.get(stamp_ns, Uncounting())
            field = "ignored" if recorded.topic == self._topics.ignored else "coverage"
            self._uncounting[stamp_ns] = known._replace(**{field: message})
        elif recorded.topic == self._topics.odometry:
            pose = build.se3_from_pose(message.pose.pose)
            stamp_ns = _stamp_ns(message, recorded)
            tree.add_odometry(message.header.frame_id, message.child_frame_id, stamp_ns, pose)
        else:
            for each in message.transforms:
                pose = build.se3_from_transform(each.transform)
                tree.add(each.header.frame_id, each.child_frame_id, _stamp_ns(each, recorded), pose)

    def _instant(self, tree: TransformTree, recorded: Recorded, labels: deque[tuple[int, Any]]) -> Instant:
        message = self._recording.decode(recorded)
        with self._usable(recorded):
            stamp_ns = _stamp_ns(message, recorded)
            frame_id = str(message.header.frame_id).removeprefix("/")
        tree.forget_before(stamp_ns - 2 * LATENCY_NS)
        while labels and labels[0][0] < stamp_ns - 2 * LATENCY_NS:
            labels.popleft()
        uncounting = self._uncounting.pop(stamp_ns, Uncounting())
        for old_ns in [each for each in self._uncounting if each < stamp_ns - 2 * LATENCY_NS]:
            del self._uncounting[old_ns]
        nearest = min(labels, key=lambda label: abs(label[0] - stamp_ns), default=None)
        if nearest is not None and abs(nearest[0] - stamp_ns) > FARTHEST_LABEL_NS:
            nearest = None
        return Instant(stamp_ns, frame_id, recorded, message, nearest, uncounting)

    @contextmanager
    def _usable(self, recorded: Recorded) -> Iterator[None]:
        """Fields of a type that a recording defines in its own way, as AdvpipeError."""
        try:
            yield
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            raise AdvpipeError(
                one_line(
                    f"{self._recording.path}: a message of {recorded.topic} at {recorded.log_time_ns} ns "
                    f"cannot be understood as {recorded.type}: {error}"
                )
            ) from None

    def _sentences(self, height_m: float | None) -> Iterator[str]:
        """How the recording was understood."""
        topics = self._topics
        boxes, odometry = topics.objects or "none", topics.odometry or "none"
        yield f"Clouds: {topics.points}. Boxes: {boxes}. Odometry: {odometry}."
        if self._mount.base:
            height = self._mount.base_SE3_lidar[2, 3]
            about = "as --lidar-height says" if height_m is not None else "as the transforms say"
            yield f"base_link is the frame {self._mount.base}; the LiDAR is {height:.2f} m above it, {about}."
        elif height_m is None:
            yield "No transform tells where the LiDAR sits: base_link is at the LiDAR (see --lidar-height)."
        if self._recording.provenance.get("kind") == "attack":
            yield "The recording is an adversarial bag of advpipe, and what it holds is taken for clean."
        if left_out := sorted(set(self._recording.topics) - topics.used - _EXPECTED):
            more = f" and {len(left_out) - _MOST_NAMED} more" if len(left_out) > _MOST_NAMED else ""
            yield f"Left out: {', '.join(left_out[:_MOST_NAMED])}{more}."
        if self._on_ground:
            yield "CARLA's bridge gives vehicles' origins on the ground: their boxes are raised onto it."


def _is_around_origin(named: NamedBox) -> bool:
    """Whether the LiDAR is above or in the box: then it is the own vehicle's."""
    x_m, y_m, _, length_m, width_m, _, yaw_rad = named.box
    along = x_m * np.cos(yaw_rad) + y_m * np.sin(yaw_rad)
    across = y_m * np.cos(yaw_rad) - x_m * np.sin(yaw_rad)
    return bool(abs(along) < length_m / 2 and abs(across) < width_m / 2)


def _stamp_ns(message: Any, recorded: Recorded) -> int:
    """The header's stamp, of markers that of the first; the time of recording where a driver left it at 0."""
    stamped = message.markers[0] if getattr(message, "markers", None) else message
    return (build.stamp_ns(stamped) if hasattr(stamped, "header") else 0) or recorded.log_time_ns
