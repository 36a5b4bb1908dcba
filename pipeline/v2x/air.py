"""Messages through the air: from what stations send to what listeners receive and know.

The simulation sends a drive's messages through it as they are made; an attack sends a recorded drive's
again, with some of them changed. The same messages meet the same fates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.v2x import V2x
from advpipe.pipeline.v2x.cam_error import CamError
from advpipe.pipeline.v2x.cam_tree import decode_cam
from advpipe.pipeline.v2x.ldm import LocalDynamicMap, Report, Snapshot, Verdict, report_of_cam
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.radio.medium import Medium
from advpipe.pipeline.v2x.radio.stations import Reception, Stations, Transmissions
from advpipe.pipeline.v2x.statistics import Statistics, Tally


@dataclass(frozen=True, slots=True)
class Sent:
    """A message that a station hands to its radio.

    number: different for each message of a drive. key: of its random draws, see `draws.message_keys`.
    station_id: the radio's own, whatever the payload claims. payload: a CAM in UPER, or what poses as one.
    """

    number: int
    key: int
    station_id: int
    request_ns: int
    payload: bytes
    power_dbm: float


@dataclass(frozen=True, slots=True)
class Received:
    """A message at one listener; `verdict` is what its Local Dynamic Map made of it."""

    listener: str
    sent: Sent
    arrival_ns: int
    power_dbm: float
    sinr_db: float
    verdict: Verdict


@dataclass(frozen=True)
class Heard:
    """What became known in one step: messages received by listeners, in order of arrival, and loads."""

    received: tuple[Received, ...]
    loads: tuple[ChannelLoad, ...]


class Air:
    """The radio medium, and the Local Dynamic Maps of those who listen.

    listeners: station ids of the vehicles whose receptions count, with their names. Everybody else's
    reception is decided as well, for the statistics, but not decoded.
    """

    def __init__(
        self,
        v2x: V2x,
        seed: int,
        geodesy: Geodesy,
        listeners: Mapping[int, str],
        buildings: Buildings | None = None,
    ) -> None:
        self._medium = Medium(v2x.radio, seed, buildings)
        self._geodesy = geodesy
        self._listeners = dict(listeners)
        self._ids = np.array(sorted(listeners), np.int64)
        self._maps = {name: LocalDynamicMap(v2x.ldm) for name in listeners.values()}
        self._on_air: dict[int, Sent] = {}
        self._on_their_way: list[Reception] = []
        self._tally = Tally()

    def advance(self, until_ns: int, stations: Stations, sent: Sequence[Sent]) -> Heard:
        """Goes on to this time, with all that was handed to the radios before it; see `Medium.advance`."""
        self._on_air.update((message.number, message) for message in sent)
        step = self._medium.advance(until_ns, stations, _transmissions(sent))
        self._tally.add(step)
        arriving = [*self._on_their_way, *step.fates.receptions(self._ids)]
        arriving.sort(key=lambda reception: (reception.arrival_ns, reception.receiver, reception.message))
        due = [reception for reception in arriving if reception.arrival_ns <= until_ns]
        self._on_their_way = arriving[len(due) :]
        received = tuple(self._receive(due))
        waiting = {reception.message for reception in self._on_their_way}
        for number in (*step.fates.messages.tolist(), *step.fates.dropped.tolist()):
            if number not in waiting:
                self._on_air.pop(number, None)
        for reception in due:
            if reception.message not in waiting:
                self._on_air.pop(reception.message, None)
        return Heard(received, step.loads)

    def snapshot(self, listener: str, now_ns: int) -> Snapshot:
        """The Local Dynamic Map of a listener."""
        return self._maps[listener].snapshot(now_ns)

    def statistics(self) -> Statistics:
        """All that has happened so far."""
        return self._tally.statistics()

    def _receive(self, receptions: Iterable[Reception]) -> Iterable[Received]:
        reports: dict[int, Report | CamError | None] = {}  # one message, many receivers
        for reception in receptions:
            sent, listener = self._on_air[reception.message], self._listeners[reception.receiver]
            if sent.number not in reports:
                reports[sent.number] = self._read(sent, reception.arrival_ns)
            report, known = reports[sent.number], self._maps[listener]
            if isinstance(report, CamError):
                verdict = known.receive_corrupt()
            else:
                verdict = known.receive(report, reception.arrival_ns)
            yield Received(
                listener, sent, reception.arrival_ns, reception.power_dbm, reception.sinr_db, verdict
            )

    def _read(self, sent: Sent, arrival_ns: int) -> Report | CamError | None:
        try:
            return report_of_cam(decode_cam(sent.payload), arrival_ns, self._geodesy)
        except CamError as error:
            return error


def _transmissions(sent: Sequence[Sent]) -> Transmissions:
    return Transmissions(
        messages=np.array([message.number for message in sent], np.int64),
        keys=np.array([message.key for message in sent], np.uint64),
        senders=np.array([message.station_id for message in sent], np.int64),
        request_ns=np.array([message.request_ns for message in sent], np.int64),
        cam_bytes=np.array([len(message.payload) for message in sent], np.int64),
        power_dbm=np.array([message.power_dbm for message in sent], np.float64),
    )
