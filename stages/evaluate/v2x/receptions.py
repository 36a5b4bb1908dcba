"""The recorded receptions of each listener of a drive, in the form that the misbehaviour checks need.

The radio is not simulated again: a drive that another tool recorded is read in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import RecordedReception, recorded_receptions
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle, claims_of_cams
from advpipe.pipeline.misbehaviour.pseudonym_links import PseudonymLinks
from advpipe.pipeline.misbehaviour.roads import NO_ROADS
from advpipe.pipeline.replay.roads import roads_of_bag
from advpipe.pipeline.replay.v2x_drive import V2xStep, read_steps
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.message_type import is_cam
from advpipe.stages.evaluate.v2x.recording import V2xRecording, read_recording

NEAR_M = 300.0
"""Messages sent within this distance are expected to arrive."""
_USUAL_SIZE_M = (4.5, 1.8)
_UNKNOWN_ID = -1
"""A station id that no CAM claims."""


@dataclass(frozen=True)
class ListenerReceptions:
    """The messages of one listener in order of arrival; all sequences are as long.

    claims, receivers: what the checks work on, the listener's own pose as it estimates it. near: numbers of
    all messages that others sent within `NEAR_M` in the window, received or not.
    """

    listener: str
    received: tuple[RecordedReception, ...]
    claims: tuple[Claim, ...]
    receivers: tuple[ReceivingVehicle, ...]
    near: frozenset[int]

    @property
    def numbers(self) -> list[int | None]:
        """Numbers in /v2x/sent of the received messages; None where the bag does not record them."""
        return [one.number for one in self.received]


@dataclass
class _Around:
    """The true surroundings of a listener: its positions by time, and the numbers of messages sent nearby."""

    places: list[tuple[int, RadioPlace]] = field(default_factory=list)
    near: set[int] = field(default_factory=set)


def read_receptions(
    reader: BagReader,
    window: Window = WHOLE_DRIVE,
    recording: V2xRecording | None = None,
    *,
    is_linked: bool = True,
) -> list[ListenerReceptions]:
    """The receptions of every receiving vehicle, by name, from the drive's beginning to the window's end.

    recording: as `read_recording` reads it from the bag. is_linked: where stations change their pseudonyms,
    claims have the first pseudonym that the listener knows of their station (`PseudonymLinks`). Raises
    AdvpipeError for a bag without its map's origin, for receptions that do not belong together
    (`recorded_receptions`), and for receptions of messages that nobody sent.
    """
    recording = recording or read_recording(reader, window.end_ns)
    around = _around(reader, recording.listeners, window)
    roads = roads_of_bag(reader) or NO_ROADS
    cams: dict[bytes | None, Cam | None] = {None: None}
    senders = true_senders(reader, window.last_ns)
    found = []
    for name, station_id in recording.listeners.items():
        recorded = recorded_receptions(reader, name, window.last_ns)
        received = [one for one in recorded if window.is_before_end(one.arrival_ns)]
        if senders is not None:
            refuse_unknown_senders(reader, name, received, senders)
        for one in received:
            if one.payload not in cams:
                cams[one.payload] = _cam(one.payload)
        arrivals_ns = [one.arrival_ns for one in received]
        claims = claims_of_cams(
            [cams[one.payload] for one in received], arrivals_ns, recording.geodesy, roads
        )
        if recording.has_pseudonyms and is_linked:
            claims = PseudonymLinks(recording.silence_s).linked(claims)
        receivers = _receivers(reader, name, station_id, around[name].places, arrivals_ns, window.last_ns)
        found.append(
            ListenerReceptions(
                name, tuple(received), tuple(claims), tuple(receivers), frozenset(around[name].near)
            )
        )
    return found


def _around(reader: BagReader, names: Iterable[str], window: Window) -> dict[str, _Around]:
    around = {name: _Around() for name in names}
    for step in read_steps(reader, window.end_ns):
        radios = {radio.station_id: radio for radio in step.radios}
        for own in step.radios:
            if own.vehicle in around:
                around[own.vehicle].places.append((step.begin_ns, own))
                around[own.vehicle].near.update(_near(step, radios, own, window))
    return around


def _near(step: V2xStep, radios: dict[int, RadioPlace], own: RadioPlace, window: Window) -> Iterator[int]:
    at_m = own.map_SE3_base[:3, 3]
    for one in step.sent:
        sender = radios[one.station_id]
        if sender is own or not window.holds(one.request_ns) or not is_cam(one.payload):
            continue
        if np.linalg.norm(sender.map_SE3_base[:3, 3] - at_m) <= NEAR_M:
            yield one.number


def true_senders(reader: BagReader, last_ns: int | None = None) -> dict[int, int] | None:
    """Station ids by the numbers of the messages that they sent; None for a bag without sent messages."""
    if V2X_SENT.name not in reader.topics:
        return None
    return {message.number: message.station_id for _, message in reader.messages(V2X_SENT.name, last_ns)}


def refuse_unknown_senders(
    reader: BagReader, name: str, received: Sequence[RecordedReception], senders: dict[int, int]
) -> None:
    """Raise AdvpipeError for a reception of a message that nobody sent, or that another station sent."""
    for one in received:
        if one.number is not None and senders.get(one.number) != one.station_id:
            raise AdvpipeError(
                f"{reader.path}: {VehicleTopics(name).true_receptions.name} at {one.arrival_ns} ns names "
                f"message {one.number} of station {one.station_id}, which {V2X_SENT.name} does not hold; "
                "record it again"
            )


def _receivers(
    reader: BagReader,
    name: str,
    station_id: int | None,
    places: Sequence[tuple[int, RadioPlace]],
    arrivals_ns: Sequence[int],
    last_ns: int | None,
) -> list[ReceivingVehicle]:
    """The listener at each arrival."""
    if not arrivals_ns:
        return []
    length_m, width_m = places[0][1].size_m[:2] if places else _USUAL_SIZE_M
    times_ns, poses = _own_poses(reader, name, places, last_ns)
    latest = np.maximum(np.searchsorted(times_ns, arrivals_ns, "right") - 1, 0)
    own_id = _UNKNOWN_ID if station_id is None else station_id
    return [
        ReceivingVehicle(own_id, x_m, y_m, yaw_rad, length_m, width_m)
        for x_m, y_m, yaw_rad in poses[latest].tolist()
    ]


def _own_poses(
    reader: BagReader, name: str, places: Sequence[tuple[int, RadioPlace]], last_ns: int | None
) -> tuple[Any, Float64]:
    """Times (K,) and x, y, yaw (K, 3) of the listener's own estimate; the truth where it makes none."""
    topic = VehicleTopics(name).odometry.name
    found = [(time_ns, radio.map_SE3_base) for time_ns, radio in places]
    if topic in reader.topics and reader.topics[topic].count:
        found = [(t, build.se3_from_pose(m.pose.pose)) for t, m in reader.messages(topic, last_ns)] or found
    if not found:
        raise UsageError(
            f"{reader.path}: the position of {name} when it received messages is unknown: record {topic} or "
            f"{V2X_STATIONS.name}"
        )
    poses = [(p[0, 3], p[1, 3], np.arctan2(p[1, 0], p[0, 0])) for _, p in found]
    return np.array([t for t, _ in found], np.int64), np.array(poses)


def _cam(payload: bytes | None) -> Cam | None:
    if payload is None:
        return None
    try:
        return decode_cam(payload)
    except CamError:
        return None
