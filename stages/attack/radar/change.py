"""Attacks on the radars of a recorded drive: their scans, and the points that repeat them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_radars import RecordedRadar, recorded_radars
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.scans import FILE, SCAN_COLUMNS
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.radar import StampedScan, radar_cloud_to_cdr, scan_from_cdr, scan_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.attacked_sensors import attacked_sensors
from advpipe.stages.attack.label_spool import LabelSpool
from advpipe.stages.attack.radar.registry import RADAR_ATTACKS
from advpipe.stages.attack.radar.schedule import ScanAttackSchedule
from advpipe.stages.attack.recording import recording_of


class RadarChange:
    """A `Change` of the victims' radar scans."""

    def __init__(self, reader: BagReader, schedules: Sequence[ScanAttackSchedule]) -> None:
        self._reader = reader
        self._scans = {one.recorded.scan_topic: one for one in schedules}
        self._points = {one.recorded.points_topic: one.recorded.scan_topic for one in schedules}
        self.topics = frozenset({*self._scans, *self._points} & reader.topics.keys())
        self._labels = LabelSpool(SCAN_COLUMNS)
        self._numbers: Counter[str] = Counter()

    def messages(self) -> Iterator[RawMessage]:
        """All messages of `topics`, in the bag's order and at its times."""
        truth = self._truths()
        wanted = {*self.topics, *(name for one in truth.values() for name in one.topic_names)}
        raws = self._reader.raw_messages(sorted(wanted & self._reader.topics.keys()))
        for _, group in groupby(raws, key=lambda raw: raw.log_time_ns):
            instant = list(group)
            for raw in instant:
                for one in truth.values():
                    if raw.topic.name in one.topic_names:
                        one.take(raw)
            attacked = {
                raw.topic.name: self._attacked(raw, truth) for raw in instant if raw.topic.name in self._scans
            }
            for raw in instant:
                name = raw.topic.name
                found = attacked.get(self._points.get(name, name))
                if name in self.topics:
                    yield raw if found is None else replace(raw, cdr=found[name in self._points])
        for schedule in self._scans.values():
            schedule.refuse_unmet_targets()

    def write_labels(self, folder: Path) -> None:
        """Write radar_labels.parquet; see `labels.scans`."""
        self._labels.copy_to(folder / FILE)

    def counts(self) -> Counter[str]:
        """How many returns the attacks added, changed and removed."""
        return Counter({f"radar returns {what}": count for what, count in self._labels.actions.items()})

    def _attacked(self, raw: RawMessage, truth: dict[str, GroundTruth]) -> tuple[bytes, bytes] | None:
        """The scan and its points after the attacks; None if they leave it as it is."""
        topic = raw.topic.name
        schedule, scan = self._scans[topic], scan_from_cdr(raw.cdr)
        number = self._numbers[topic]
        self._numbers[topic] += 1
        returns, rows = schedule.of(
            raw.log_time_ns, scan.returns, lambda: self._boxes(schedule.recorded, scan, truth)
        )
        if not rows:
            return None
        about = {"topic": topic, "scan": number, "stamp_ns": scan.stamp_ns}
        self._labels.add([{"attacked": None, **about, **row} for row in rows])
        rcs_dbsm = schedule.recorded.radar.rcs_dbsm(returns)
        return (
            scan_to_cdr(returns, scan.stamp_ns, scan.frame_id),
            radar_cloud_to_cdr(returns, rcs_dbsm, scan.stamp_ns, scan.frame_id),
        )

    def _truths(self) -> dict[str, GroundTruth]:
        """Of each victim whose true road users the bag holds."""
        found = {}
        for vehicle in {one.recorded.vehicle for one in self._scans.values()}:
            topics = VehicleTopics(vehicle)
            if topics.objects.name in self._reader.topics and objects_topic(self._reader, topics):
                found[vehicle] = GroundTruth(self._reader, topics, topics.objects.name)
        return found

    def _boxes(self, recorded: RecordedRadar, scan: StampedScan, truth: dict[str, GroundTruth]) -> Boxes:
        if recorded.vehicle not in truth:
            raise UsageError(
                f"{self._reader.path} has no true road users of {recorded.vehicle}, by which it aims; "
                "record the drive with a LiDAR on it"
            )
        return truth[recorded.vehicle].boxes(scan.stamp_ns, scan.frame_id)


def attack_radars(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> RadarChange:
    """The drive with the radars of some vehicles attacked.

    Each attack acts on the radars of its `victim`: without one, of the only vehicle with radars, or `ego`.

    Raises AdvpipeError for a victim without radars in the bag, for a radar that it does not have, for bad
    parameters, and for a schedule that begins after the recording.
    """
    recording, radars = recording_of(reader), recorded_radars(reader)
    by_topic: dict[str, list[AttackSpec]] = {}
    for spec in attacks:
        for one in attacked_radars(str(reader.path), spec, radars):
            by_topic.setdefault(one.scan_topic, []).append(spec)
    schedules = [
        ScanAttackSchedule(one, by_topic[one.scan_topic], recording, seed)
        for one in radars
        if one.scan_topic in by_topic
    ]
    return RadarChange(reader, schedules)


def attacked_radars(bag: str, spec: AttackSpec, radars: Sequence[RecordedRadar]) -> list[RecordedRadar]:
    """The radars that an attack acts on, of those in a bag. Raises UsageError where there is none."""
    topic = "radar_msgs/RadarScan by advpipe"
    return attacked_sensors(bag, spec, RADAR_ATTACKS.find(spec.type), radars, "radar", topic)
