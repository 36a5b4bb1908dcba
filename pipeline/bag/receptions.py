"""What vehicles received by radio, as a bag holds it: each message, how it arrived and what it truly was."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.v2x.codec.btp import parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.message_type import CAM, MessageType, message_type_at

_RECEIVED = VehicleTopics("").received_raw.name.removeprefix("/")

T = TypeVar("T")

_Place = tuple[int, int]
"""A stamp in nanoseconds, and how many messages of that stamp come before."""


class RecordedReception(NamedTuple):
    """A message that a vehicle received.

    payload: the message in UPER, or what poses as one; None for a packet that is for no known receiver.
    power_dbm, sinr_db: NaN where not recorded. number: of the message in /v2x/sent that it truly
    was; station_id: of the radio that sent it. Both None where not recorded.
    """

    arrival_ns: int
    payload: bytes | None
    power_dbm: float = math.nan
    sinr_db: float = math.nan
    number: int | None = None
    station_id: int | None = None


def receiving_vehicles(reader: BagReader) -> list[str]:
    """Names of the vehicles whose received messages a bag holds, sorted."""
    names = (name.removeprefix("/") for name in reader.topics if name.endswith(_RECEIVED))
    return sorted(name.removesuffix(_RECEIVED) for name in names if name.count("/") == _RECEIVED.count("/"))


def recorded_receptions(
    reader: BagReader, vehicle: str, last_ns: int | None = None, kind: MessageType = CAM
) -> list[RecordedReception]:
    """The messages of a type that a vehicle received, by arrival; of log times up to `last_ns`, included.

    A packet that is for no known receiver counts as a CAM.

    Reads `v2x/rx/raw` and, where they are, `v2x/rx/info` and `ground_truth/receptions`, which belong
    together by their stamps. Raises AdvpipeError for topics of other types, and for a message beside
    `v2x/rx/raw` that belongs to none on it; where no packet is of the type, the two topics beside are not
    read, and such a message is not found.
    """
    topics = VehicleTopics(vehicle)
    for topic in (topics.received_raw, topics.reception_info, topics.true_receptions):
        _refuse_other_type(reader, topic)
    packets = _by_place(reader, topics.received_raw, last_ns, partial(_message, kind=kind))
    if packets and not any(is_kind for is_kind, _ in packets.values()):
        return []
    infos = _by_place(reader, topics.reception_info, last_ns, _power_and_sinr)
    truths = _by_place(reader, topics.true_receptions, last_ns, _number_and_station)
    for topic, beside in ((topics.reception_info, infos), (topics.true_receptions, truths)):
        if strays := beside.keys() - packets.keys():
            raise AdvpipeError(
                f"{reader.path}: {topic.name} at {min(strays)[0]} ns matches no message of "
                f"{topics.received_raw.name}; record it again"
            )
    return [
        RecordedReception(
            place[0], payload, *infos.get(place, (math.nan, math.nan)), *truths.get(place, (None, None))
        )
        for place, (is_kind, payload) in sorted(packets.items())
        if is_kind
    ]


def _refuse_other_type(reader: BagReader, topic: Topic) -> None:
    known = reader.topics.get(topic.name)
    if known is not None and known.type != topic.type:
        raise AdvpipeError(f"{reader.path}: {topic.name} holds {known.type}, not {topic.type}")


def _by_place(
    reader: BagReader, topic: Topic, last_ns: int | None, kept: Callable[[Any], T]
) -> dict[_Place, T]:
    """What is kept of each message of a topic; none of one that the bag does not have."""
    if topic.name not in reader.topics:
        return {}
    found: dict[_Place, T] = {}
    counts: Counter[int] = Counter()
    for _, message in reader.messages(topic.name, last_ns):
        stamp_ns = build.stamp_ns(message)
        found[stamp_ns, counts[stamp_ns]] = kept(message)
        counts[stamp_ns] += 1
    return found


def _message(packet: Any, kind: MessageType) -> tuple[bool, bytes | None]:
    """Whether a packet of BTP-B holds a message of this type, by its port; and the message."""
    try:
        port, _, payload = parse_btp_packet(bytes(packet.data))
    except CamError:
        return kind is CAM, None
    found = message_type_at(port)
    if found is None:
        return kind is CAM, None
    return (True, payload) if found is kind else (False, None)


def _power_and_sinr(info: Any) -> tuple[float, float]:
    return float(info.power_dbm), float(info.sinr_db)


def _number_and_station(truth: Any) -> tuple[int, int]:
    return int(truth.number), int(truth.station_id)
