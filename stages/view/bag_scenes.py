"""The frames of a bag as scenes, alone or beside an attack; each is made when somebody looks at it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import Frame, FrameSlice, find_lidar_topic, read_frames, vehicle_topics
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import CLASSES, count_points
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.pipeline.viewer.scene import (
    ATTACKED,
    BELIEVED_PATH,
    CLEAN,
    TRUE_PATH,
    TRUTH,
    Fact,
    SceneBox,
    SceneLine,
    ViewerScene,
    object_title,
)
from advpipe.stages.view.ground_lines import Paths, lane_lines, read_lanes
from advpipe.stages.view.poses import lidar_SE3_map
from advpipe.stages.view.radio_boxes import on_both, origin_of, radio_boxes

PATIENCE_S = 1.5
"""How long to wait for the paths of a bag before the first frame is shown."""


class _Recording:
    """One bag, by the log times of its clouds."""

    def __init__(self, path: Path, lidar_topic: str) -> None:
        self.path, self.lidar_topic = path, lidar_topic
        self.reader = BagReader(path)
        self.paths = Paths(self.reader)
        self.times_ns: npt.NDArray[np.int64] = (
            self.reader.log_times_ns(lidar_topic)
            if lidar_topic in self.reader.topics
            else np.zeros(0, np.int64)
        )

    def frame(self, time_ns: int) -> Frame | None:
        """The cloud of this log time, with its boxes; None where there is none."""
        (found,) = np.nonzero(self.times_ns == time_ns)
        if not len(found):
            return None
        index = int(found[0])
        return next(iter(read_frames(self.path, FrameSlice(index, index + 1), lidar_topic=self.lidar_topic)))


class BagScenes:
    """The frames of a bag, and of what attacks made of it.

    names: of the attacks' bags. Memory holds one frame at a time, and the paths of the vehicles.
    Raises UsageError for a bag without LiDAR clouds.
    """

    def __init__(self, bag: Path, attacks: Mapping[str, Path], lidar_topic: str | None = None) -> None:
        reader = BagReader(bag)
        self._lidar_topic = find_lidar_topic(reader, lidar_topic)
        self._topics = vehicle_topics(self._lidar_topic)
        self._bag = _Recording(bag, self._lidar_topic)
        if not len(self._bag.times_ns):
            raise UsageError(f"{bag} holds no LiDAR clouds ({self._lidar_topic} is empty)")
        self._attacks = tuple(attacks.values())
        self.names = tuple(attacks)
        self._opened: dict[int, _Recording] = {}
        self._lanes = read_lanes(reader)
        self._origin = origin_of(reader)
        self._bag.paths.start(PATIENCE_S)

    def __len__(self) -> int:
        return len(self._bag.times_ns)

    @property
    def labels(self) -> list[str]:
        """What the time line says of each frame."""
        since_s = (self._bag.times_ns - self._bag.times_ns[0]) * 1e-9
        return [f"{index}: {time_s:.2f} s" for index, time_s in enumerate(since_s.tolist())]

    def scene(self, index: int, attack: int | None) -> ViewerScene:
        """A frame, beside what the attack of this number made of it.

        Raises AdvpipeError for a frame that cannot be read.
        """
        time_ns = int(self._bag.times_ns[index])
        before = self._bag.frame(time_ns)
        assert before is not None
        other = None if attack is None else self._attacked(attack)
        after = other.frame(time_ns) if other else None
        change = cloud_difference(before.cloud, after.cloud) if after else None
        place = lidar_SE3_map(self._bag.reader, self._lidar_topic, time_ns)
        name = self._bag.path.name if attack is None else self.names[attack]
        is_left_out = other is not None and after is None
        return ViewerScene(
            name=f"{name}-{index:06d}",
            title=f"{name}, frame {self.labels[index]}",
            clean=before.cloud,
            attacked=after.cloud if after else None,
            change=change,
            boxes=(*_truth_boxes(before, after), *self._radio(other if after else None, time_ns, place)),
            lines=tuple(self._lines(other if after else None, place)),
            note="The adversarial bag has no such frame: shown is the clean one." if is_left_out else "",
            label=self.labels[index],
        )

    def _attacked(self, number: int) -> _Recording:
        """An adversarial bag, opened when it is asked for."""
        if number not in self._opened:
            recording = _Recording(self._attacks[number], self._lidar_topic)
            recording.paths.start(PATIENCE_S)
            self._opened[number] = recording
        return self._opened[number]

    def _radio(self, other: _Recording | None, time_ns: int, place: Float64 | None) -> Sequence[SceneBox]:
        if place is None:
            return []
        clean = radio_boxes(self._bag.reader, self._topics, time_ns, place, self._origin)
        if other is None:
            return clean
        return list(on_both(clean, radio_boxes(other.reader, self._topics, time_ns, place, self._origin)))

    def _lines(self, other: _Recording | None, place: Float64 | None) -> Iterator[SceneLine]:
        if place is None:
            return
        yield from lane_lines(self._lanes, place)
        yield from self._bag.paths.lines(TRUE_PATH, place)
        yield from self._bag.paths.lines(BELIEVED_PATH, place, CLEAN if other else "")
        if other:
            yield from other.paths.lines(BELIEVED_PATH, place, ATTACKED)


def _truth_boxes(before: Frame, after: Frame | None) -> Iterator[SceneBox]:
    boxes = before.boxes
    clouds = [frame.cloud for frame in (before, after) if frame]
    points = [count_points(xyz(cloud), boxes.geometry) for cloud in clouds]
    for number, (box, label) in enumerate(zip(boxes.geometry, boxes.labels, strict=True)):
        speed_mps = float(np.linalg.norm(boxes.velocity_mps[number]))
        speed = [Fact("speed", f"{speed_mps:.1f} m/s")] if np.isfinite(speed_mps) else []
        yield SceneBox(
            TRUTH,
            box.tolist(),
            object_title(CLASSES[label], boxes.ids[number]),
            id=boxes.ids[number],
            group=f"{CLASSES[label]}s",
            facts=(
                Fact("range", f"{np.hypot(box[0], box[1]):.1f} m"),
                Fact("LiDAR points", *(str(count[number]) for count in points)),
                *speed,
                Fact("size", " × ".join(f"{length_m:.1f}" for length_m in box[3:6]) + " m"),
            ),
        )
