"""What vehicles received by radio, as a bag holds it: each message, how it arrived and what it truly was."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.v2x.codec.btp import parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.message_type import CAM, MessageType, message_type_at

_RECEIVED = VehicleTopics("").received_raw.name.removeprefix("/")

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
    `v2x/rx/raw` that belongs to none on it.
    """
    topics = VehicleTopics(vehicle)
    packets = _by_place(reader, topics.received_raw, last_ns)
    infos, truths = (
        _by_place(reader, topic, last_ns) for topic in (topics.reception_info, topics.true_receptions)
    )
    for topic, beside in ((topics.reception_info, infos), (topics.true_receptions, truths)):
        if strays := beside.keys() - packets.keys():
            raise AdvpipeError(
                f"{reader.path}: {topic.name} at {min(strays)[0]} ns matches no message of "
                f"{topics.received_raw.name}; record it again"
            )
    return [
        _reception(place[0], payload, infos.get(place), truths.get(place))
        for place in sorted(packets)
        for found, payload in [_message(packets[place])]
        if found is kind
    ]


def _by_place(reader: BagReader, topic: Topic, last_ns: int | None) -> dict[_Place, Any]:
    """The messages of a topic; none of one that the bag does not have."""
    known = reader.topics.get(topic.name)
    if known is None:
        return {}
    if known.type != topic.type:
        raise AdvpipeError(f"{reader.path}: {topic.name} holds {known.type}, not {topic.type}")
    found: dict[_Place, Any] = {}
    counts: Counter[int] = Counter()
    for _, message in reader.messages(topic.name, last_ns):
        stamp_ns = build.stamp_ns(message)
        found[stamp_ns, counts[stamp_ns]] = message
        counts[stamp_ns] += 1
    return found


def _message(packet: Any) -> tuple[MessageType, bytes | None]:
    """What a packet of BTP-B holds, by its port."""
    try:
        port, _, payload = parse_btp_packet(bytes(packet.data))
    except CamError:
        return CAM, None
    kind = message_type_at(port)
    return (CAM, None) if kind is None else (kind, payload)


def _reception(arrival_ns: int, payload: bytes | None, info: Any, truth: Any) -> RecordedReception:
    return RecordedReception(
        arrival_ns,
        payload,
        *((math.nan, math.nan) if info is None else (float(info.power_dbm), float(info.sinr_db))),
        *((None, None) if truth is None else (int(truth.number), int(truth.station_id))),
    )
