"""GPS spoofing of a recorded drive: the fixes, and everything that depends on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.localisation import estimate_message
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.labels import fixes
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import MAP_FRAME, TF, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.messages.v2x import stations_of_message
from advpipe.pipeline.replay.recorded_filter import (
    GNSS_FIX,
    default_victim,
    read_filter,
    vehicles_with_filter,
)
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.gnss.base import gnss_traits
from advpipe.stages.attack.gnss.estimated_cams import EstimatedCams
from advpipe.stages.attack.gnss.labels import write_labels
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.gnss.reported_cams import ReportedCams
from advpipe.stages.attack.gnss.spoofing_schedule import SpoofingSchedule
from advpipe.stages.attack.gnss.victim import SpoofedVehicle, spoof_vehicle
from advpipe.stages.attack.recording import recording_of
from advpipe.stages.attack.v2x.base import MessageEditor

__all__ = ["GnssChange", "spoof"]


class GnssChange:
    """A `Change` of the victims' fixes, odometry and /tf; `editors` change the CAMs that they send.

    vehicles: victims with a receiver and a filter in the bag. others: attacks on stations with CAMs alone,
    which change only V2X topics.
    """

    def __init__(
        self,
        reader: BagReader,
        vehicles: Sequence[SpoofedVehicle],
        others: Sequence[tuple[str, Sequence[AttackSpec]]],
        seed: int,
    ) -> None:
        self.vehicles, self.others = tuple(vehicles), tuple(others)
        self._reader, self._seed = reader, seed
        names = [VehicleTopics(victim.vehicle) for victim in vehicles]
        changed = {topic.name for one in names for topic in (one.gnss_fix, one.odometry)}
        if vehicles and TF.name in reader.topics:
            changed.add(TF.name)
        self.topics = frozenset(changed)
        self._estimates = {VehicleTopics(one.vehicle).base_frame: one.estimates for one in vehicles}

    def messages(self) -> Iterator[RawMessage]:
        """All messages of `topics`, in the bag's order and at its times."""
        spoofed = {VehicleTopics(one.vehicle).gnss_fix.name: iter(one.fixes) for one in self.vehicles}
        odometry = {VehicleTopics(one.vehicle).odometry.name: one for one in self.vehicles}
        if not self.topics:
            return
        for raw in self._reader.raw_messages(sorted(self.topics)):
            if raw.topic.name in spoofed:
                yield next(spoofed[raw.topic.name])
            elif raw.topic.name in odometry:
                victim = odometry[raw.topic.name]
                estimate = victim.estimates[raw.log_time_ns]
                topic, message, _ = estimate_message(VehicleTopics(victim.vehicle), estimate)
                yield replace(raw, cdr=serialise(message, topic.type))
            else:
                yield self._transforms(raw)

    def write_labels(self, folder: Path) -> None:
        """Write gnss_labels.parquet; see `labels.write_labels`. The labels of V2X cover CAMs."""
        write_labels(self.vehicles, folder / fixes.FILE)

    def counts(self) -> Counter[str]:
        """How many fixes the attacks spoofed, and how many they removed."""
        false = [record for one in self.vehicles for record in one.records if record.is_false]
        return Counter("fixes missing" if record.reported is None else "fixes spoofed" for record in false)

    def editors(self) -> tuple[MessageEditor, ...]:
        """The editors of the victims' CAMs, at the start of the drive; none for a bag without CAMs."""
        if V2X_STATIONS.name not in self._reader.topics:
            return ()
        drive, recorded = V2xDrive(self._reader), read_filter(self._reader)
        recording = recording_of(self._reader)
        return (
            *(EstimatedCams(one, recorded, drive.v2x) for one in self.vehicles),
            *(
                ReportedCams(SpoofingSchedule(station, specs, recording, self._seed), recorded.geodesy)
                for station, specs in self.others
            ),
        )

    def _transforms(self, raw: RawMessage) -> RawMessage:
        message = self._reader.decode(raw)
        transforms = [self._transform(transform) for transform in message.transforms]
        return replace(raw, cdr=serialise(replace(message, transforms=transforms), raw.topic.type))

    def _transform(self, transform: Any) -> Any:
        """The transform of a victim from its new estimate instead of the recorded one."""
        estimates = self._estimates.get(transform.child_frame_id, {})
        estimate = estimates.get(build.stamp_ns(transform))
        if estimate is None or transform.header.frame_id != MAP_FRAME:
            return transform
        link = (MAP_FRAME, transform.child_frame_id, estimate.map_SE3_base)
        return build.transforms(estimate.stamp_ns, [link]).transforms[0]


def spoof(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> GnssChange:
    """The drive with the GPS of some vehicles spoofed.

    Each attack schedules its `victim`: an instrumented vehicle, whose own filter runs again on the false
    fixes, or any other station of the drive, whose CAMs tell the false place (see `reported_cams`). Without
    a victim, it is the only vehicle with GPS, or `ego`.

    Raises AdvpipeError for a victim that is not in the bag or has no GPS, for bad parameters, for a
    schedule that begins after the recording, and for two attacks on one victim at the same time.
    """
    recording, by_victim = recording_of(reader), dict[str, list[AttackSpec]]()
    known, stations = vehicles_with_filter(reader), None
    for spec in attacks:
        by_victim.setdefault(_victim(reader, spec, known), []).append(spec)
    schedules = {name: SpoofingSchedule(name, specs, recording, seed) for name, specs in by_victim.items()}
    others = tuple((name, tuple(specs)) for name, specs in by_victim.items() if name not in known)
    if others:
        stations = _stations(reader)
    for name, specs in others:
        if stations is None or name not in stations:
            raise UsageError(
                f"{specs[0].type}: {reader.path} has no vehicle {name!r} with GPS or CAMs; "
                f"{known_names(name, known, 'those with GPS')}"
            )
        _refuse_filterless(specs, name)
    recorded = read_filter(reader) if by_victim else None
    spoofed = tuple(
        spoof_vehicle(reader, recorded, schedules[name])
        for name in by_victim
        if recorded is not None and name in known
    )
    return GnssChange(reader, spoofed, others, seed)


def _victim(reader: BagReader, spec: AttackSpec, known: Sequence[str]) -> str:
    if spec.victim is not None:
        if f"/{spec.victim}{GNSS_FIX}" in reader.topics and spec.victim not in known:
            raise UsageError(
                f"{spec.type}: {reader.path} has fixes of {spec.victim}, but not its estimate and where that "
                "started; record it again"
            )
        return spec.victim
    if not known:
        raise UsageError(f"{spec.type}: {reader.path} has no vehicle with GPS (no topic …{GNSS_FIX})")
    if (usual := default_victim(known)) is None:
        raise UsageError(f"{spec.type}: name a victim; {', '.join(known)} have GPS")
    return usual


def _stations(reader: BagReader) -> set[str]:
    if V2X_STATIONS.name not in reader.topics:
        return set()
    return {
        radio.vehicle
        for _, message in reader.messages(V2X_STATIONS.name)
        for radio in stations_of_message(message)
    }


def _refuse_filterless(specs: Sequence[AttackSpec], victim: str) -> None:
    for spec in specs:
        if gnss_traits(GNSS_ATTACKS.find(spec.type)).needs_filter:
            raise UsageError(
                f"{spec.type}: {victim} has no filter in the bag, which this attack needs; attack an "
                "instrumented vehicle, or choose an attack without a filter"
            )
