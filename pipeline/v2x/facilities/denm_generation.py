"""The DEN basic service: when a DENM is sent, repeated, updated and cancelled (EN 302 637-3, 6.1)."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from advpipe.pipeline.v2x.facilities.denm import ActionId, Denm, EventKind, encode_denm
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.pipeline.v2x.facilities.path_history import PathHistory
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import DenmRules

CANCELLATIONS = 3
"""How often a cancellation is sent."""
UPDATE_M = 4.0
"""An event that has moved so far has a new state."""
NUMBERS = 2**16


@dataclass
class _Event:
    """An event that the station has announced. left: DENMs that are still sent; None: until it ends."""

    denm: Denm
    next_ns: int
    left: int | None = None


class DenmGenerator:
    """Sends the DENMs of one station. phase_ns: how long after an update of its state it sends.

    An event that has moved by `UPDATE_M`, or for which half of its validity is over, is detected anew.

    station_id: what it calls itself. number: of its next event.
    """

    def __init__(self, rules: DenmRules, station_id: int, phase_ns: int, number: int = 0) -> None:
        self._validity_s, self._interval_ns = rules.validity_s, round(rules.repetition_s * 1e9)
        self._update_ns = rules.validity_s * 500_000_000
        self._phase_ns = phase_ns
        self.station_id, self._number = station_id, number % NUMBERS
        self._path = PathHistory()
        self._events: dict[EventKind, _Event] = {}
        self._ending: list[_Event] = []

    @property
    def is_active(self) -> bool:
        """Whether it announces an event, or its end."""
        return bool(self._events or self._ending)

    def rename(self, station_id: int, number: int) -> None:
        """Take another station id, and begin anew without a past; call it while it is not active."""
        self.station_id, self._number, self._path = station_id, number % NUMBERS, PathHistory()

    def update(self, now_ns: int, state: StationState, kinds: Collection[EventKind]) -> None:
        """Take in the station's own state, and what happens to it now."""
        self._path.add(state.time_ns, state.latitude_deg, state.longitude_deg, state.altitude_m)
        for kind in EventKind:
            event = self._events.get(kind)
            if kind in kinds and event is None:
                self._events[kind] = _Event(self._announced(kind, state), now_ns + self._phase_ns)
            elif kind in kinds and event is not None:
                is_old = state.time_ns - event.denm.detection_ns >= self._update_ns
                if is_old or _moved_m(event.denm, state) > UPDATE_M:
                    event.denm = self._state_of(event.denm, state)
            elif event is not None:
                del self._events[kind]
                ended = event.denm.terminated(self.station_id, state.time_ns)
                self._ending.append(_Event(ended, now_ns + self._phase_ns, CANCELLATIONS))

    def messages_before(self, end_ns: int) -> Iterator[tuple[int, bytes]]:
        """The times and bytes of the DENMs that it sends before this time, in the order of time."""
        due: list[tuple[int, bytes]] = []
        for event in (*self._events.values(), *self._ending):
            while event.next_ns < end_ns and event.left != 0:
                due.append((event.next_ns, encode_denm(event.denm)))
                event.next_ns += self._interval_ns
                event.left = None if event.left is None else event.left - 1
        self._ending = [event for event in self._ending if event.left]
        yield from sorted(due)

    def _announced(self, kind: EventKind, state: StationState) -> Denm:
        action = ActionId(self.station_id, self._number)
        self._number = (self._number + 1) % NUMBERS
        first = Denm(
            station_id=self.station_id,
            action=action,
            detection_ns=state.time_ns,
            reference_ns=state.time_ns,
            station_type=state.station_type,
            latitude_deg=None,
            longitude_deg=None,
            validity_s=self._validity_s,
            interval_s=self._interval_ns / 1e9,
            kind=kind,
        )
        return self._state_of(first, state)

    def _state_of(self, denm: Denm, state: StationState) -> Denm:
        """The same event, detected anew with the station's present state: its validity begins again."""
        place = state.latitude_deg, state.longitude_deg, state.altitude_m
        return replace(
            denm,
            detection_ns=state.time_ns,
            reference_ns=state.time_ns,
            latitude_deg=state.latitude_deg,
            longitude_deg=state.longitude_deg,
            altitude_m=state.altitude_m,
            speed_mps=state.speed_mps,
            heading_rad=state.heading_rad,
            traces=tuple(self._path.points(*place, state.time_ns)),
        )


def _moved_m(denm: Denm, state: StationState) -> float:
    if denm.latitude_deg is None or denm.longitude_deg is None:
        return math.inf
    moved_m = east_north_m(denm.latitude_deg, denm.longitude_deg, state.latitude_deg, state.longitude_deg)
    return math.hypot(*moved_m)
