"""The radio medium as Artery has simulated it: outcomes of messages from its records of receptions."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from advpipe.pipeline.artery.records import BusyRatio
from advpipe.pipeline.v2x.radio.load import ChannelLoad, window_ends
from advpipe.pipeline.v2x.radio.medium import Step
from advpipe.pipeline.v2x.radio.stations import (
    Outcome,
    Reception,
    ReceptionOutcomes,
    Stations,
    Transmissions,
)

GIVEN_UP_NS = 1_000_000_000
"""A message that nobody has received after this time reaches nobody any more."""


class OpenMessage(NamedTuple):
    """A message whose outcome is not known yet."""

    number: int
    sender: int
    request_ns: int


@dataclass
class RecordedMedium:
    """Takes the place of `Medium`. `note` receptions and loads before the step that asks for them.

    Why a message did not reach a station, Artery does not tell: the outcome is `WEAK` for all reasons.
    """

    tells_why: ClassVar[bool] = False

    _open: dict[int, OpenMessage] = field(default_factory=dict)
    _receptions: dict[int, list[Reception]] = field(default_factory=dict)
    _coming: deque[BusyRatio] = field(default_factory=deque)
    _ratios: dict[int, float] = field(default_factory=dict)
    _advanced_ns: int | None = None
    _now_ns: int = 0
    """No message arrives before it."""

    def note(self, receptions: Iterable[Reception], busy_ratios: Iterable[BusyRatio]) -> None:
        """Note receptions and loads up to some time after the coming step's end, by time."""
        for reception in receptions:
            self._receptions.setdefault(reception.message, []).append(reception)
        self._coming.extend(busy_ratios)

    def advance(self, until_ns: int, stations: Stations, transmissions: Transmissions) -> Step:
        """See `Medium.advance`; a message is complete when its first reception is due."""
        for values in zip(
            transmissions.messages.tolist(),
            transmissions.senders.tolist(),
            transmissions.request_ns.tolist(),
            strict=True,
        ):
            message = OpenMessage(*values)
            self._open[message.number] = message
        complete = [message for message in self._open.values() if self._is_complete(message, until_ns)]
        dropped = self._dropped(until_ns, stations)
        for message in (*complete, *dropped):
            del self._open[message.number]
        for message in dropped:
            self._receptions.pop(message.number, None)
        outcomes = self._outcomes(complete, dropped, stations)
        first_ns, self._advanced_ns = self._advanced_ns, until_ns
        if first_ns is None:
            first_ns = min([until_ns - 1, *transmissions.request_ns.tolist()])
        return Step(outcomes, tuple(self._loads(first_ns, until_ns, stations)))

    def _loads(self, first_ns: int, until_ns: int, stations: Stations) -> Iterator[ChannelLoad]:
        """The load of each window that ended: what each station had told last by then."""
        for end_ns in window_ends(first_ns, until_ns):
            while self._coming and self._coming[0].time_ns <= end_ns:
                ratio = self._coming.popleft()
                self._ratios[ratio.station_id] = ratio.ratio
            known = [station for station in stations.ids.tolist() if station in self._ratios]
            if known:
                ratios = np.array([self._ratios[station] for station in known], np.float64)
                yield ChannelLoad(end_ns, np.array(known, np.int64), ratios)

    def _is_complete(self, message: OpenMessage, until_ns: int) -> bool:
        receptions = self._receptions.get(message.number)
        if receptions is None:
            return until_ns >= message.request_ns + GIVEN_UP_NS
        return min(reception.arrival_ns for reception in receptions) <= until_ns

    def _dropped(self, until_ns: int, stations: Stations) -> list[OpenMessage]:
        """The messages that are never sent; Artery's own stations send all that they hand to their radios."""
        return []

    def _outcomes(
        self, messages: Sequence[OpenMessage], dropped: Sequence[OpenMessage], stations: Stations
    ) -> ReceptionOutcomes:
        shape = len(messages), len(stations.ids)
        outcome = np.full(shape, Outcome.WEAK, np.uint8)
        power_dbm, sinr_db = np.full(shape, np.nan), np.full(shape, np.nan)
        delay_ns, end_ns = np.zeros(shape, np.int64), np.zeros(shape[0], np.int64)
        column = {station: index for index, station in enumerate(stations.ids.tolist())}
        distance_m = np.full(shape, np.inf)  # of a sender that has left
        for row, message in enumerate(messages):
            receptions = self._receptions.pop(message.number, [])
            end_ns[row] = min((one.arrival_ns for one in receptions), default=message.request_ns)
            if message.sender in column:
                own = column[message.sender]
                outcome[row, own] = Outcome.OWN
                distance_m[row] = np.linalg.norm(stations.antenna_m - stations.antenna_m[own], axis=1)
            for reception in receptions:
                if (place := column.get(reception.receiver)) is not None:
                    outcome[row, place] = Outcome.RECEIVED
                    power_dbm[row, place], sinr_db[row, place] = reception.power_dbm, reception.sinr_db
                    delay_ns[row, place] = max(reception.arrival_ns, self._now_ns) - end_ns[row]
        request_ns = np.array([message.request_ns for message in messages], np.int64)
        return ReceptionOutcomes(
            messages=np.array([message.number for message in messages], np.int64),
            senders=np.array([message.sender for message in messages], np.int64),
            request_ns=request_ns,
            start_ns=request_ns,
            end_ns=end_ns,
            receivers=stations.ids,
            outcome=outcome,
            power_dbm=power_dbm,
            sinr_db=sinr_db,
            distance_m=distance_m,
            delay_ns=delay_ns,
            dropped=np.array([message.number for message in dropped], np.int64),
        )
