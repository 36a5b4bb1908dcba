"""What each listener of a recorded drive received, message by message, with the true sender.

The bag's own receptions are told apart by sending the drive again: the same messages meet the same fates.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.markers import lanes_of_markers
from advpipe.pipeline.messages.topics import LANES, VehicleTopics
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.misbehaviour.claim import Claim, Receiver, claims_of_cams
from advpipe.pipeline.misbehaviour.roads import NO_ROADS, RoadMap, lanes
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.v2x.air import Received
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import cam_of_tree
from advpipe.pipeline.v2x.statistics import Statistics

NEAR_M = 300.0
"""Within which messages ought to arrive."""


@dataclass(frozen=True)
class Receptions:
    """The messages of one listener in order of arrival; all sequences are as long.

    received: with the message's number and the radio that truly sent it. claims, receivers: what the checks
    work on, the listener's own pose as it estimates it. radios: where the true sender was, None if unknown.
    near: numbers of all messages that others sent within `NEAR_M` in the window, received or not.
    """

    listener: str
    station_id: int
    received: tuple[Received, ...]
    claims: tuple[Claim, ...]
    receivers: tuple[Receiver, ...]
    radios: tuple[RadioPlace | None, ...]
    near: frozenset[int]

    @property
    def numbers(self) -> list[int]:
        return [one.sent.number for one in self.received]


def read_receptions(reader: BagReader, listeners: Collection[int] | None = None) -> list[Receptions]:
    """Of every instrumented vehicle with a radio, by name; of these station ids with `listeners`.

    Raises AdvpipeError as `send_again` does.
    """
    return send_again(reader, listeners).receptions


class SentAgain(NamedTuple):
    """What comes of sending a drive again. statistics: of the radio's steps in the window."""

    receptions: list[Receptions]
    statistics: Statistics


def send_again(
    reader: BagReader, listeners: Collection[int] | None = None, window: Window = WHOLE_DRIVE
) -> SentAgain:
    """Sends a drive from its beginning to the window's end; receptions are of all that time.

    Raises AdvpipeError for a bag without V2X, or whose receptions are not those of its messages.
    """
    drive = V2xDrive(reader, window.end_ns)
    if listeners is not None:
        drive.listeners = {station: drive.stations[station] for station in sorted(listeners)}
    received: dict[str, list[tuple[Received, RadioPlace | None]]] = {}
    own: dict[str, list[tuple[int, RadioPlace]]] = {}
    near: dict[str, set[int]] = {}
    before: dict[int, RadioPlace] = {}
    air, is_counting = drive.air(), False
    for step in drive.steps():
        if not is_counting and step.begin_ns >= window.begin_ns:
            is_counting = True
            air.restart_statistics()
        radios = {radio.station_id: radio for radio in step.radios}
        for station, name in drive.listeners.items():
            if station in radios:
                own.setdefault(name, []).append((step.begin_ns, radios[station]))
                near.setdefault(name, set()).update(_near(step, radios, radios[station], window))
        for one in drive.send(air, step, step.sent).received:
            sender = one.sent.station_id
            if window.is_before_end(one.arrival_ns):
                place = radios.get(sender) or before.get(sender)
                received.setdefault(one.listener, []).append((one, place))
        before = radios
    if listeners is None:
        _check_arrivals(reader, drive.listeners, received, window)
    origin = drive.origin
    geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
    roads = roads_of_bag(reader) or NO_ROADS
    receptions = [
        _of_listener(
            reader,
            name,
            station,
            received.get(name, []),
            own.get(name, []),
            frozenset(near.get(name, ())),
            geodesy,
            roads,
            window.last_ns,
        )
        for station, name in sorted(drive.listeners.items(), key=lambda item: item[1])
    ]
    return SentAgain(receptions, air.statistics())


def roads_of_bag(reader: BagReader) -> RoadMap | None:
    """The roads of a drive; None for a bag that does not tell them."""
    if LANES.name not in reader.topics:
        return None
    return next((lanes(lanes_of_markers(message)) for _, message in reader.messages(LANES.name)), None)


def _near(step: V2xStep, radios: dict[int, RadioPlace], own: RadioPlace, window: Window) -> Iterator[int]:
    at_m = own.map_SE3_base[:3, 3]
    for one in step.sent:
        sender = radios.get(one.station_id)
        if sender is None or sender is own or not window.holds(one.request_ns):
            continue
        if np.linalg.norm(sender.map_SE3_base[:3, 3] - at_m) <= NEAR_M:
            yield one.number


def _check_arrivals(
    reader: BagReader, listeners: dict[int, str], received: dict[str, list[Any]], window: Window
) -> None:
    for name in listeners.values():
        topic = VehicleTopics(name).received_raw.name
        sent_again = np.array(sorted(one.arrival_ns for one, _ in received.get(name, [])), np.int64)
        recorded = reader.log_times_ns(topic) if topic in reader.topics else np.array([], np.int64)
        if not np.array_equal(sent_again, recorded[window.is_before_end(recorded)]):
            raise AdvpipeError(
                f"{reader.path}: {topic} is not what its messages make when they are sent again; "
                "record or attack it with this version"
            )


def _of_listener(
    reader: BagReader,
    name: str,
    station_id: int,
    received: list[tuple[Received, RadioPlace | None]],
    own: list[tuple[int, RadioPlace]],
    near: frozenset[int],
    geodesy: Geodesy,
    roads: RoadMap,
    last_ns: int | None,
) -> Receptions:
    cams: dict[int, Cam | None] = {}
    for one, _ in received:
        if one.sent.number not in cams:
            cams[one.sent.number] = _cam(one)
    claims = claims_of_cams(
        [cams[one.sent.number] for one, _ in received],
        [one.arrival_ns for one, _ in received],
        geodesy,
        roads,
    )
    size_m = own[0][1].size_m if own else (4.5, 1.8, 1.5)
    times_ns, poses = _own_poses(reader, name, own, last_ns)
    receivers = []
    for one, _ in received:
        index = max(int(np.searchsorted(times_ns, one.arrival_ns, "right")) - 1, 0)
        x_m, y_m, yaw_rad = poses[index].tolist()
        receivers.append(Receiver(station_id, x_m, y_m, yaw_rad, size_m[0], size_m[1]))
    return Receptions(
        name,
        station_id,
        tuple(one for one, _ in received),
        tuple(claims),
        tuple(receivers),
        tuple(place for _, place in received),
        near,
    )


def _own_poses(
    reader: BagReader, name: str, own: list[tuple[int, RadioPlace]], last_ns: int | None
) -> tuple[Any, Float64]:
    """Times (K,) and x, y, yaw (K, 3) of the listener's own estimate; the truth where it makes none."""
    topic = VehicleTopics(name).odometry.name
    if topic in reader.topics:
        found = [(t, build.se3_from_pose(m.pose.pose)) for t, m in reader.messages(topic, last_ns)]
    else:
        found = [(t, radio.map_SE3_base) for t, radio in own]
    if not found:
        found = [(0, np.eye(4))]
    poses = [(p[0, 3], p[1, 3], np.arctan2(p[1, 0], p[0, 0])) for _, p in found]
    return np.array([t for t, _ in found], np.int64), np.array(poses)


def _cam(received: Received) -> Cam | None:
    if received.tree is None:
        return None
    try:
        return cam_of_tree(received.tree)
    except CamError:
        return None
