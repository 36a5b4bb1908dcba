"""Attacks on the cameras of a recorded drive: their main images alone.

An attacker reaches the images on their way, or what the camera sees; its calibration, and depth,
segmentation and 2D boxes, which are ground truth, stay.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import RecordedCamera, cameras_of
from advpipe.pipeline.labels.images import DROPPED, FILE, IMAGE_COLUMNS
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.compressed_image import UInt8, image_from_cdr, image_to_cdr, png_file
from advpipe.pipeline.scenario.acting import acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.attacked_sensors import attacked_sensors
from advpipe.stages.attack.camera.base import CameraImage
from advpipe.stages.attack.camera.drive import RecordedDrive, SceneTaker
from advpipe.stages.attack.camera.planned import PlannedAttack
from advpipe.stages.attack.camera.registry import CAMERA_ATTACKS
from advpipe.stages.attack.camera.scene_light import SceneLight
from advpipe.stages.attack.camera.schedule import ImageAttackSchedule, Row, TouchedImage, delayed_row
from advpipe.stages.attack.label_spool import LabelSpool
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.recording import RecordedTimes, recording_of


@dataclass(frozen=True)
class _Held:
    """An image in the queue of an attack that delays, and what its label begins with."""

    raw: RawMessage
    touched: TouchedImage
    about: Row

    @property
    def due_ns(self) -> int:
        return self.raw.log_time_ns + self.touched.delay_ns


@dataclass
class _AttackedCamera:
    """One camera under attack. number: of its next image."""

    scenes: SceneTaker
    schedule: ImageAttackSchedule
    queue: deque[_Held] = field(default_factory=deque)
    number: int = 0


class CameraChange:
    """A `Change` of the victims' camera images."""

    def __init__(
        self,
        reader: BagReader,
        cameras: Mapping[str, _AttackedCamera],
        recording: RecordedTimes,
        kept: Mapping[str, UInt8],
    ) -> None:
        self._reader, self._cameras, self._end_ns = reader, cameras, recording.end_ns
        self._kept = kept
        self.topics = frozenset(cameras)
        self._labels = LabelSpool(IMAGE_COLUMNS)

    def messages(self) -> Iterator[RawMessage]:
        """All messages of `topics`, in log-time order."""
        scenes = [one.scenes for one in self._cameras.values()]
        wanted = {*self.topics, *(name for each in scenes for name in each.topic_names)}
        raws = self._reader.raw_messages(sorted(wanted & self._reader.topics.keys()))
        for time_ns, group in groupby(raws, key=lambda raw: raw.log_time_ns):
            instant = list(group)
            for raw in instant:
                for each in scenes:
                    each.take(raw)
            due = [raw for one in self._cameras.values() for raw in self._released(one, time_ns)]
            yield from sorted(due, key=lambda raw: raw.log_time_ns)
            for raw in instant:
                if raw.topic.name in self.topics:
                    yield from self._arrives(raw)
        for one in self._cameras.values():
            yield from self._released(one, self._end_ns)
            for held in one.queue:
                row: Row = {"attack": held.touched.delayed_by, "action": DROPPED}
                self._labels.add([{**held.about, **row}])

    def write_labels(self, folder: Path) -> None:
        """Write camera_labels.parquet, see `labels.images`, and the pictures that attacks keep."""
        self._labels.copy_to(folder / FILE)
        for name, rgb in self._kept.items():
            (folder / name).write_bytes(png_file(rgb))

    def counts(self) -> Counter[str]:
        """How many images the attacks dropped, delayed, replaced and painted on."""
        return Counter({f"camera images {what}": count for what, count in self._labels.actions.items()})

    def _arrives(self, raw: RawMessage) -> Iterator[RawMessage]:
        """What of a camera's stream arrives at the time of one of its images."""
        one = self._cameras[raw.topic.name]
        stamped = image_from_cdr(raw.cdr)
        touched = one.schedule.of(
            raw.log_time_ns,
            CameraImage(stamped, one.number),
            lambda: one.scenes.scene(stamped.stamp_ns, stamped.frame_id),
        )
        about: Row = {"topic": raw.topic.name, "image": one.number, "stamp_ns": stamped.stamp_ns}
        one.number += 1
        held = _Held(raw, touched, about)
        if touched.delay_ns and touched.image is not None:
            one.queue.append(held)
            return
        yield from self._released(one, raw.log_time_ns, everything=True)
        yield from self._delivered(held, raw.log_time_ns)

    def _released(
        self, one: _AttackedCamera, until_ns: int, everything: bool = False
    ) -> Iterator[RawMessage]:
        """What leaves a queue until a time: what is due, or all of it, then."""
        while one.queue and (everything or one.queue[0].due_ns <= until_ns):
            held = one.queue.popleft()
            yield from self._delivered(held, min(held.due_ns, until_ns))

    def _delivered(self, held: _Held, time_ns: int) -> Iterator[RawMessage]:
        raw, touched = held.raw, held.touched
        late_ns = time_ns - raw.log_time_ns
        rows = [*touched.rows, *([delayed_row(touched.delayed_by, late_ns)] if touched.delayed_by else [])]
        self._labels.add([{**held.about, **row} for row in rows])
        if touched.image is None:
            return
        if not rows:
            yield raw
            return
        cdr = image_to_cdr(touched.image.stamped)
        yield replace(raw, cdr=cdr, log_time_ns=time_ns, publish_time_ns=raw.publish_time_ns + late_ns)


def attack_cameras(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> CameraChange:
    """The drive with the cameras of some vehicles attacked.

    Each attack acts on the cameras of its `victim`: without one, of the only vehicle with cameras, or `ego`.

    Raises AdvpipeError for a victim without cameras in the bag, for a camera that it does not have, for bad
    parameters, and for a schedule that begins after the recording.
    """
    recording, cameras = recording_of(reader), cameras_of(reader)
    light, kept = SceneLight(reader), dict[str, UInt8]()
    by_camera: dict[RecordedCamera, list[PlannedAttack]] = {}
    for spec in attacks:
        own = attacked_cameras(str(reader.path), spec, cameras)
        recording.refuse_outside(spec)
        attack_class = CAMERA_ATTACKS.find(spec.type)
        attack = attack_class(**resolved_parameters(spec, attack_class))
        acts = acting_on_messages(spec, recording.start_ns, seed)
        drives = {each.image_topic: RecordedDrive(reader, each, light, kept, acts) for each in own}
        planned = PlannedAttack(spec, attack, acts, drives, seed)
        for each in own:
            by_camera.setdefault(each, []).append(planned)
    attacked = {}
    for camera in cameras:
        if camera in by_camera:
            schedule = ImageAttackSchedule(by_camera[camera], camera.image_topic)
            scenes = SceneTaker(reader, camera, schedule.needs_scene)
            attacked[camera.image_topic] = _AttackedCamera(scenes, schedule)
    return CameraChange(reader, attacked, recording, kept)


def attacked_cameras(bag: str, spec: AttackSpec, cameras: Sequence[RecordedCamera]) -> list[RecordedCamera]:
    """The cameras that an attack acts on, of those in a bag. Raises UsageError where there is none."""
    topic = "sensor_msgs/CompressedImage named /vehicle/camera/image/compressed"
    return attacked_sensors(bag, spec, CAMERA_ATTACKS.find(spec.type), cameras, "camera", topic)
