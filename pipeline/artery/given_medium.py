"""Artery's radio medium for messages that advpipe gives it: those of a recorded drive, attacked or not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.artery import given_records
from advpipe.pipeline.artery.given_link import GivenLink
from advpipe.pipeline.artery.recorded_medium import OpenMessage, RecordedMedium
from advpipe.pipeline.artery.records import Arrival, BusyRatio, Ended, Record
from advpipe.pipeline.v2x.radio.load import WINDOW_NS
from advpipe.pipeline.v2x.radio.medium import Step
from advpipe.pipeline.v2x.radio.stations import Reception, Stations, Transmissions
from advpipe.pipeline.v2x.stack import LINK_BYTES

ON_ITS_WAY_NS = 50_000
"""Longest time from the end of a transmission to its arrival; light travels 15 km in it."""

LONGEST_WAIT_NS = 10_000_000_000
"""A message that has waited so long in its radio is never sent: Artery's queues hold a hundred."""


class GivenMedium(RecordedMedium):
    """Takes the place of `Medium`: Artery decides who receives a message, when, and how well.

    Artery simulates a step as soon as it is told, in the same steps as the drive. overhead_bytes: what the
    radio adds to each message of `Transmissions.cam_bytes`.
    """

    def __init__(self, link: GivenLink, overhead_bytes: int) -> None:
        super().__init__()
        self._link, self._overhead_bytes = link, overhead_bytes
        self._zero_ns: int | None = None
        self._present: set[int] = set()
        self._ended_ns: dict[int, int] = {}
        self._until_ns = 0

    def advance(self, until_ns: int, stations: Stations, transmissions: Transmissions) -> Step:
        """See `Medium.advance`."""
        if self._zero_ns is None:
            first_ns = min([until_ns, *transmissions.request_ns.tolist()])
            self._zero_ns = first_ns - first_ns % WINDOW_NS
        zero_ns, self._now_ns, self._until_ns = self._zero_ns, self._until_ns, until_ns
        block = given_records.block(self._told(stations, transmissions, zero_ns, until_ns))
        known = self._open.keys() | set(transmissions.messages.tolist())
        self._take(self._link.step(block, until_ns - zero_ns), zero_ns, known)
        step = super().advance(until_ns, stations, transmissions)
        for number in (*step.outcomes.messages.tolist(), *step.outcomes.dropped.tolist()):
            self._ended_ns.pop(number, None)
        return step

    def _told(
        self, stations: Stations, transmissions: Transmissions, zero_ns: int, until_ns: int
    ) -> Iterator[bytes]:
        present = set(stations.ids.tolist())
        yield from map(given_records.left, sorted(self._present - present))
        self._present = present
        for station_id, antenna_m in zip(stations.ids.tolist(), stations.antenna_m.tolist(), strict=True):
            yield given_records.place(station_id, *antenna_m)
        power_dbm = transmissions.power_dbm
        for index in np.argsort(transmissions.request_ns, kind="stable").tolist():
            assert power_dbm is not None  # a channel tells the power of each message
            size = int(transmissions.cam_bytes[index]) + self._overhead_bytes - LINK_BYTES
            yield given_records.message(
                int(transmissions.request_ns[index]) - zero_ns,
                int(transmissions.senders[index]),
                int(transmissions.messages[index]),
                float(power_dbm[index]),
                transmissions.contents[index].rjust(max(size, 0), b"\0"),  # without packets, headers lack
            )
        yield given_records.until(until_ns - zero_ns)

    def _take(self, records: list[Record], zero_ns: int, known: set[int]) -> None:
        receptions, ratios = list[Reception](), list[BusyRatio]()
        for record in records:
            if isinstance(record, Arrival) and record.packet_id in known:
                arrival_ns = record.time_ns + zero_ns
                receptions.append(
                    Reception(
                        *(record.packet_id, record.station_id, arrival_ns, record.power_dbm, record.sinr_db)
                    )
                )
            elif isinstance(record, Ended) and record.packet_id in known:
                self._ended_ns[record.packet_id] = record.time_ns + zero_ns
            elif isinstance(record, BusyRatio):
                ratios.append(record._replace(time_ns=record.time_ns + zero_ns))
        self.note(receptions, ratios)

    def _is_complete(self, message: OpenMessage, until_ns: int) -> bool:
        ended_ns = self._ended_ns.get(message.number)
        return ended_ns is not None and ended_ns + ON_ITS_WAY_NS <= until_ns

    def _dropped(self, until_ns: int, stations: Stations) -> list[OpenMessage]:
        present = set(stations.ids.tolist())
        return [
            message
            for message in self._open.values()
            if message.number not in self._ended_ns
            and (message.sender not in present or until_ns - message.request_ns > LONGEST_WAIT_NS)
        ]
