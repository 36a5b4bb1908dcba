"""Relays GPS fixes, one by one, with false positions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.campaigns.relay.counts import RelayCounts
from advpipe.pipeline.campaigns.relay.outgoing import ATTACKED, UNCHANGED, OutgoingMessage
from advpipe.pipeline.campaigns.relay.place import MapPlace
from advpipe.pipeline.campaigns.relay.recorder import Recorder
from advpipe.pipeline.campaigns.relay.settings import RelaySettings, vehicle_of
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels import fixes
from advpipe.pipeline.labels.growing_table import GrowingTable
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.messages.debug import FALSE, TRUE, ClaimedPosition, positions_cdr, positions_topic
from advpipe.pipeline.messages.types import typestore
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.gnss.base import gnss_traits
from advpipe.stages.attack.gnss.labels import label
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.gnss.spoofing_schedule import SpoofingSchedule
from advpipe.stages.attack.gnss.victim import FixRecord, spoof_fix
from advpipe.stages.attack.recording import RecordedTimes

_LEAST_WAY_M = 0.5
"""A shorter way between two fixes tells no heading."""

_ENDLESS_NS = 2**62


class FixRelay:
    """The victim is whoever receives the topic; its heading is the direction between its last true fixes."""

    def __init__(
        self, settings: RelaySettings, specs: Sequence[AttackSpec], place: MapPlace, recorder: Recorder
    ) -> None:
        for spec in specs:
            if gnss_traits(GNSS_ATTACKS.find(spec.type)).needs_filter:
                raise UsageError(f"{spec.type} needs the victim's filter, which a relay does not have")
        self.counts = RelayCounts()
        self.topics: tuple[Topic, ...] = (Topic(settings.fix_topic, "sensor_msgs/msg/NavSatFix"),)
        self._settings, self._specs, self._place, self._recorder = settings, specs, place, recorder
        self._vehicle = vehicle_of(settings.fix_topic)
        self._labels = GrowingTable(recorder.folder / fixes.FILE, fixes.FIX_COLUMNS)
        self._last_m: Float64 | None = None
        self._heading_rad = 0.0
        self.begin(0)

    def begin(self, start_ns: int) -> None:
        """Schedules count from here."""
        times = RecordedTimes(start_ns, _ENDLESS_NS)
        self._schedule = SpoofingSchedule(self._vehicle, self._specs, times, self._settings.seed)
        self._outgoing: list[OutgoingMessage] = []

    def take(self, cdr: bytes, now_ns: int, arrival_s: float) -> None:
        """A fix that has come. Raises AdvpipeError for an attack beyond its bounds."""
        (topic,) = self.topics
        raw = RawMessage(topic, "", cdr, now_ns, now_ns, self.counts.received)
        self.counts.received += 1
        try:
            message: Any = typestore().deserialize_cdr(cdr, topic.type)
            true = np.array([message.latitude, message.longitude, message.altitude])
        except Exception:  # rosbags fails in any way on bytes that are no fix
            self._outgoing.append(OutgoingMessage(topic, cdr, UNCHANGED, arrival_s))
            return
        if np.isfinite(true).all():
            self._place.set_origin(*true.tolist())
            self._turn(self._place.geodesy.to_map(true))
        if not self._place.is_known:
            self._outgoing.append(OutgoingMessage(topic, cdr, UNCHANGED, arrival_s))
            return
        spoofed, record = spoof_fix(
            raw, message, self._schedule, self._place.geodesy, self._heading_rad, _no_filter
        )
        fate = ATTACKED if record.is_false else UNCHANGED
        self._outgoing.append(OutgoingMessage(topic, spoofed.cdr, fate, arrival_s))
        self._labels.add_row({"vehicle": self._vehicle, "fix": self.counts.received - 1, **label(record)})
        self._show(record, now_ns)

    def due(self, now_ns: int, now_s: float) -> Iterator[OutgoingMessage]:
        """The fixes that are to be sent by now."""
        outgoing, self._outgoing = self._outgoing, []
        yield from outgoing

    def end(self) -> None:
        """Nothing waits."""

    def write_labels(self) -> None:
        """Finish gnss_labels.parquet."""
        self._labels.close()

    def _turn(self, position_m: Float64) -> None:
        if self._last_m is None:
            self._last_m = position_m
        east_m, north_m, _ = position_m - self._last_m
        if math.hypot(east_m, north_m) >= _LEAST_WAY_M:
            self._heading_rad = math.atan2(north_m, east_m)
            self._last_m = position_m

    def _show(self, record: FixRecord, now_ns: int) -> None:
        if record.false_fix is None or not self._recorder.debug:
            return
        positions = {TRUE: record.true_m, FALSE: record.false_fix.position_m}
        known = {role: place_m for role, place_m in positions.items() if place_m is not None}
        claim = ClaimedPosition(0, record.false_fix.attack, known)
        cdr = positions_cdr(record.stamp_ns, [claim])
        self._recorder.record(positions_topic(self.topics[0].name), cdr, now_ns)


def _no_filter(fix: Float64) -> Innovation:
    raise AdvpipeError("this attack needs the victim's filter, which a relay does not have")
