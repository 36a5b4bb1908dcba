"""Receptions of every station of a drive, instrumented or not, as data sets such as VeReMi need them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import recorded_receptions
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.v2x.message_type import is_cam
from advpipe.stages.evaluate.v2x.receptions import refuse_unknown_senders, true_senders


class StationReception(NamedTuple):
    """One message, `number` in /v2x/sent, at one receiver; station ids of both. power_dbm: may be NaN."""

    receiver: int
    sender: int
    number: int
    arrival_ns: int
    power_dbm: float


def receptions_of_all(reader: BagReader, drive: V2xDrive) -> Iterator[tuple[V2xStep, list[StationReception]]]:
    """Each step with its CAMs and their receptions, for each receiver in order of arrival.

    The bag records what the instrumented vehicles received; for all others the radio is simulated again. A
    message that was sent after the last instant with recorded positions is left out, whoever received it.
    Raises UsageError for a bag that does not record who truly sent what was received.
    """
    sent: set[int] = set()
    listeners = dict(drive.listeners)
    recorded = {station: deque(_recorded(reader, name, station)) for station, name in listeners.items()}
    ids = {name: station for station, name in drive.stations.items()}
    for step, replayed in drive.sent_again(drive.stations.keys() - listeners.keys()):
        cams = tuple(one for one in step.sent if is_cam(one.payload))
        sent |= {one.number for one in cams}
        receptions = [
            StationReception(
                ids[one.listener], one.sent.station_id, one.sent.number, one.arrival_ns, one.power_dbm
            )
            for one in replayed
        ]
        for waiting in recorded.values():
            while waiting and (step.end_ns is None or waiting[0].arrival_ns <= step.end_ns):
                receptions.append(waiting.popleft())
        yield step._replace(sent=cams), [one for one in receptions if one.number in sent]


def _recorded(reader: BagReader, name: str, station: int) -> Iterator[StationReception]:
    received = recorded_receptions(reader, name)
    refuse_unknown_senders(reader, name, received, true_senders(reader) or {})
    for one in received:
        if one.number is None or one.station_id is None:
            raise UsageError(
                f"{reader.path}: {VehicleTopics(name).true_receptions.name} does not say which sent message "
                f"{name} received at {one.arrival_ns} ns; record the drive again with this version"
            )
        yield StationReception(station, one.station_id, one.number, one.arrival_ns, one.power_dbm)
