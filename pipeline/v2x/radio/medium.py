"""The radio medium, simulated step by step: from transmissions to reception outcomes."""

from __future__ import annotations

from operator import attrgetter
from typing import ClassVar, NamedTuple

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.radio.access import Access
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.draws import Draws
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.link import Link
from advpipe.pipeline.v2x.radio.load import WINDOW_NS, ChannelLoad, busy_ratio, window_ends
from advpipe.pipeline.v2x.radio.ofdm import CONTENTION_SLOTS, Ofdm
from advpipe.pipeline.v2x.radio.reception import Receiver
from advpipe.pipeline.v2x.radio.shadow_field import ShadowField
from advpipe.pipeline.v2x.radio.stations import ReceptionOutcomes, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio


class Step(NamedTuple):
    """The results of one step: outcomes of messages, and the load of each window that ended in it."""

    outcomes: ReceptionOutcomes
    loads: tuple[ChannelLoad, ...]


_BY_REQUEST = attrgetter("request_ns")
_BY_END = attrgetter("end_ns", "start_ns")


class Medium:
    """The channel that all stations share.

    >>> medium = Medium(scenario.v2x.radio, seed=1)
    >>> for stations, transmissions, until_ns in drive:
    ...     outcomes, loads = medium.advance(until_ns, stations, transmissions)

    A message's outcome is known once the medium has advanced past its end; that of one sent just before the
    end of a step comes with the next step. Dividing the same time into other steps changes nothing.
    """

    tells_why: ClassVar[bool] = True

    def __init__(self, radio: Radio, seed: int, buildings: Buildings | None = None) -> None:
        draws = Draws(seed)
        self._radio = radio
        self._ofdm = Ofdm(radio)
        self._draws = draws
        self._link = Link(radio, draws, buildings, _shadow_field(radio, seed))
        self._access = Access(self._ofdm, round(radio.queue_delay_max_s * 1e9))
        self._receiver = Receiver(radio, draws)
        self._stations = Stations(np.empty(0, np.int64), np.empty((0, 3)))
        self._sent: list[RadioFrame] = []
        self._now_ns: int | None = None

    def advance(self, until_ns: int, stations: Stations, transmissions: Transmissions) -> Step:
        """Advance from the last `until_ns` to this one.

        stations: all stations during this time; a missing one has left, and its queued messages are dropped.
        transmissions: requested in this time, at or after the last `until_ns` and before this one.
        Raises ValueError for transmissions from other times or unknown stations.
        """
        requests_ns = transmissions.request_ns
        first_ns = int(min(requests_ns, default=until_ns)) if self._now_ns is None else self._now_ns
        if until_ns < first_ns:
            raise ValueError(f"the medium has advanced to {first_ns} ns already, beyond {until_ns} ns")
        if len(requests_ns) and not first_ns <= requests_ns.min() <= requests_ns.max() < until_ns:
            raise ValueError(f"transmissions are not all between {first_ns} and {until_ns} ns")
        dropped = self._rearrange(stations)
        requests = self._frames(stations, transmissions)
        sent, expired = self._access.run(requests, until_ns)
        self._sent += sent
        ended = [frame for frame in self._sent if not frame.is_reported and frame.end_ns <= until_ns]
        ended.sort(key=_BY_END)
        lost = np.array([frame.message for frame in (*dropped, *expired)], np.int64)
        outcomes = self._receiver.outcomes(ended, self._sent, stations, lost)
        loads = tuple(self._load(end_ns) for end_ns in window_ends(first_ns, until_ns))
        self._forget(ended, until_ns)
        return Step(outcomes, loads)

    def _rearrange(self, stations: Stations) -> list[RadioFrame]:
        """Take over the stations of this step; return the dropped messages of stations that left."""
        former, self._stations = self._stations, stations
        if np.array_equal(former.ids, stations.ids):
            return []
        columns = former.columns_of(stations.ids)
        places = dict(zip(stations.ids.tolist(), range(len(stations.ids)), strict=True))
        for frame in (*self._sent, *self._access.waiting()):
            frame.rearrange(columns, places.get(frame.sender_id, -1))
        return self._access.rearrange(columns)

    def _frames(self, stations: Stations, transmissions: Transmissions) -> list[RadioFrame]:
        """The new messages, in order of their requests."""
        radio, keys = self._radio, transmissions.keys
        senders = stations.columns_of(transmissions.senders)
        if (senders < 0).any():
            raise ValueError(f"station {transmissions.senders[senders < 0][0]} sends but is not on the road")
        power_dbm = transmissions.power_dbm
        if power_dbm is None:
            power_dbm = np.full(len(transmissions), radio.transmit_power_dbm)
        received_dbm, distance_m = self._link.received(stations, senders, keys, power_dbm)
        hearing = received_dbm >= radio.carrier_sense_dbm
        slots = (self._draws.of_messages("backoff", keys) * (CONTENTION_SLOTS + 1)).astype(np.int64)
        columns = (
            transmissions.messages,
            keys.view(np.int64),
            transmissions.senders,
            senders,
            transmissions.request_ns,
            self._ofdm.air_time_ns(transmissions.cam_bytes),
            self._ofdm.frame_bits(transmissions.cam_bytes),
            slots,
        )
        scalars = zip(*(column.tolist() for column in columns), strict=True)
        frames = [
            RadioFrame(*values, *rows)
            for values, *rows in zip(scalars, received_dbm, distance_m, hearing, strict=True)
        ]
        return sorted(frames, key=_BY_REQUEST)

    def _load(self, end_ns: int) -> ChannelLoad:
        frames = [f for f in self._sent if f.start_ns < end_ns and f.end_ns > end_ns - WINDOW_NS]
        return ChannelLoad(end_ns, self._stations.ids, busy_ratio(frames, len(self._stations.ids), end_ns))

    def _forget(self, ended: list[RadioFrame], until_ns: int) -> None:
        """Forget all frames but those on the air, those overlapping them, and the current load window's."""
        for frame in ended:
            frame.is_reported = True
        window_ns = until_ns - until_ns % WINDOW_NS
        needed_ns = min([frame.start_ns for frame in self._sent if not frame.is_reported], default=window_ns)
        needed_ns = min(needed_ns, window_ns)
        self._sent = [f for f in self._sent if not f.is_reported or f.end_ns > needed_ns]
        self._now_ns = until_ns


def _shadow_field(radio: Radio, seed: int) -> ShadowField | None:
    if radio.shadowing is None or radio.shadowing.correlation_distance_m is None:
        return None
    rng = named_generator(seed, "v2x", "shadow field")
    return ShadowField(radio.shadowing.correlation_distance_m, rng)
