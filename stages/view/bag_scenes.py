"""The frames of a bag as scenes, alone or beside an attack; each is made when somebody looks at it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.pipeline.viewer.map_lines import lane_lines, read_lanes
from advpipe.pipeline.viewer.poses import frame_SE3_map
from advpipe.pipeline.viewer.scene import (
    ALWAYS,
    ATTACKED,
    BELIEVED_PATH,
    CLEAN,
    TRUE_PATH,
    SceneBox,
    SceneLine,
    ViewerScene,
)
from advpipe.stages.view.attacked_frames import Runs, attacked_runs
from advpipe.stages.view.debug_marks import TouchedCloud, claims, touched_cloud
from advpipe.stages.view.radio_boxes import on_both, origin_of, radio_boxes
from advpipe.stages.view.recording import Recording, find_viewpoint
from advpipe.stages.view.report_detections import FrameDetections, ReportDetections, find_detections
from advpipe.stages.view.truth_boxes import station_boxes, truth_boxes

PATIENCE_S = 1.5
"""How long to wait for the paths of a bag before the first frame is shown."""

_LEFT_OUT = "The adversarial bag has no such frame: shown is the clean one."
_CLOUD_LEFT_OUT = "The adversarial bag has no such cloud: shown is the clean one, with the attacked messages."
_FROM_DEBUG = "What was touched is known from the debug topic; moved points stand where the attack put them."
_NO_CLOUDS = np.zeros(0, POINT_DTYPE)


@dataclass(frozen=True)
class _Clouds:
    """What the LiDAR saw in a frame: before, the frame of the bag; touched, with what an attack did to it."""

    before: Frame | None = None
    touched: TouchedCloud | None = None
    detections: FrameDetections | None = None
    notes: tuple[str, ...] = ()


class BagScenes:
    """The frames of a bag, and of what attacks made of it.

    names: of the attacks' bags. reports: in whose tables detections are looked up. Memory holds one frame at
    a time, the paths of the vehicles, and the detections of the bags that were looked at.
    Raises UsageError for a bag with neither LiDAR clouds nor a vehicle's poses.
    """

    def __init__(
        self,
        bag: Path,
        attacks: Mapping[str, Path],
        lidar_topic: str | None = None,
        reports: Sequence[Path] = (),
    ) -> None:
        self._viewpoint = find_viewpoint(BagReader(bag), lidar_topic)
        self._topics = self._viewpoint.topics
        self._bag = Recording(bag, self._viewpoint)
        self._attacks = tuple(attacks.values())
        self.names = tuple(attacks)
        self._reports = reports
        self._opened: dict[int, Recording] = {}
        self._runs: dict[int, Runs] = {}
        self._detections: dict[int | None, ReportDetections | AdvpipeError | None] = {}
        self._lanes = read_lanes(self._bag.reader)
        self._origin = origin_of(self._bag.reader)
        self._bag.paths.start(PATIENCE_S)

    def __len__(self) -> int:
        return len(self._bag.times_ns)

    @property
    def labels(self) -> list[str]:
        """What the time line says of each frame."""
        since_s = (self._bag.times_ns - self._bag.times_ns[0]) * 1e-9
        return [f"{index}: {time_s:.2f} s" for index, time_s in enumerate(since_s.tolist())]

    def attacked_runs(self, attack: int) -> Runs:
        """The frames that the attack of this number touches, for the marks of the time line."""
        if attack not in self._runs:
            topic, times_ns = self._viewpoint.timing_topic, self._bag.times_ns
            self._runs[attack] = attacked_runs(self._attacks[attack], topic, times_ns)
        return self._runs[attack]

    def scene(self, index: int, attack: int | None) -> ViewerScene:
        """A frame, beside what the attack of this number made of it.

        Raises AdvpipeError for a frame or a report that cannot be read.
        """
        time_ns = int(self._bag.times_ns[index])
        other = None if attack is None else self._attacked(attack)
        beside = other if other and (other.has(time_ns) or not self._viewpoint.has_clouds) else None
        told = beside or (other if other and other.changes_messages else None)  # its messages are all kept
        clouds = self._clouds(index, time_ns, attack, beside)
        left_out = [_CLOUD_LEFT_OUT if told else _LEFT_OUT] if other and not beside else []
        notes = [*clouds.notes, *left_out]
        place = frame_SE3_map(
            self._bag.reader, self._topics, self._viewpoint.timing_topic, self._viewpoint.frame_id, time_ns
        )
        boxes, lines = list[SceneBox](), list[SceneLine]()
        if clouds.before is not None:
            attacked = clouds.touched.attacked if clouds.touched and beside else None
            boxes += truth_boxes(clouds.before, attacked, clouds.detections)
            boxes += clouds.detections.predictions if clouds.detections else ()
        if place is not None:
            if clouds.before is None:
                boxes += station_boxes(self._bag.reader, time_ns, place, self._topics.vehicle)
            boxes += self._radio(told, time_ns, place)
            claimed, connecting = claims(
                (told or self._bag).debug, time_ns, place, ATTACKED if told else ALWAYS
            )
            boxes += claimed
            lines = [*self._lines(told, place), *connecting]
        name = self._bag.path.name if attack is None else self.names[attack]
        touched = clouds.touched
        clean = touched.clean if touched else clouds.before.cloud if clouds.before else _NO_CLOUDS
        return ViewerScene(
            name=f"{name}-{index:06d}",
            title=f"{name}, frame {self.labels[index]}",
            clean=clean,
            attacked=touched.attacked if touched else clean if told else None,
            change=touched.change if touched else None,
            boxes=tuple(boxes),
            lines=tuple(lines),
            note=" ".join(notes),
            label=self.labels[index],
        )

    def _clouds(self, index: int, time_ns: int, attack: int | None, beside: Recording | None) -> _Clouds:
        before = self._bag.frame(time_ns)
        if before is None:
            return _Clouds()
        after = beside.frame(time_ns) if beside else None
        if after is not None:
            change = cloud_difference(before.cloud, after.cloud)
            touched: TouchedCloud | None = TouchedCloud(before.cloud, after.cloud, change)
        else:
            touched = touched_cloud(self._bag.debug, self._viewpoint.timing_topic, time_ns, before.cloud)
        notes = [_FROM_DEBUG] if touched and not after else []
        report = self._report(attack)
        if isinstance(report, AdvpipeError):
            notes.append(f"No detections: {report}.")
            return _Clouds(before, touched, notes=tuple(notes))
        detections = report.frame(index, before, after.cloud if after else None) if report else None
        if report and detections:
            notes.append(f"Detections with a score of at least {report.min_score:.2f}, of {report.name}.")
        return _Clouds(before, touched, detections, tuple(notes))

    def _attacked(self, number: int) -> Recording:
        """An adversarial bag, opened when it is asked for."""
        if number not in self._opened:
            recording = Recording(self._attacks[number], self._viewpoint)
            recording.paths.start(PATIENCE_S)
            self._opened[number] = recording
        return self._opened[number]

    def _report(self, attack: int | None) -> ReportDetections | AdvpipeError | None:
        """The detections on an attack's bag, or on the clean one alone, read when they are asked for."""
        if attack not in self._detections:
            try:
                name = None if attack is None else self.names[attack]
                self._detections[attack] = find_detections(self._reports, name)
            except AdvpipeError as error:  # a damaged report
                self._detections[attack] = error
        return self._detections[attack]

    def _radio(self, other: Recording | None, time_ns: int, place: Float64) -> Sequence[SceneBox]:
        clean = radio_boxes(self._bag.reader, self._topics, time_ns, place, self._origin)
        if other is None or not other.changes_messages:
            return clean
        return list(on_both(clean, radio_boxes(other.reader, self._topics, time_ns, place, self._origin)))

    def _lines(self, other: Recording | None, place: Float64) -> list[SceneLine]:
        paths = self._bag.paths
        if other and not other.changes_messages:  # of which only some may be in its frames
            other = None
        return [
            *lane_lines(self._lanes, place),
            *paths.lines(TRUE_PATH, place),
            *paths.lines(BELIEVED_PATH, place, CLEAN if other else ALWAYS),
            *(other.paths.lines(BELIEVED_PATH, place, ATTACKED) if other else ()),
        ]
