"""What security stopped: the messages that receivers verified and rejected, attacked ones and others."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.latched import ReceiversInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles
from advpipe.pipeline.labels.messages import has_labels, read_labels
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number
from advpipe.stages.evaluate.report.section import Table

NOTE = (
    "Messages that reached the radios of instrumented vehicles. Attacked: changed, added or delayed by an "
    "attack. Accepted: signed with a valid ticket, fresh and not replayed; only they reach the Local Dynamic "
    "Map and misbehaviour detection. An insider's attack is signed as true messages are, so that security "
    "does not stop it. Unknown signer: the receiver had not yet received the certificate, which stations "
    "send once a second; this happens to honest messages, too."
)


def security_tables(bags: Sequence[tuple[Path, str]]) -> tuple[Table, ...]:
    """One table on the bags, given with their names, whose messages are signed; none if none are."""
    lines = [line for bag, name in bags if (line := _line(BagReader(bag), bag, name)) is not None]
    heads = (
        *("bag", "attacked, received", "accepted", "rejected %", "why"),
        *("others, received", "rejected %", "why"),
    )
    return (Table("Security: messages that receivers verified", heads, tuple(lines), NOTE),) if lines else ()


def _line(reader: BagReader, bag: Path, name: str) -> tuple[str, ...] | None:
    """None for a bag without signed messages."""
    if SCENARIO_INFO.name not in reader.topics:
        return None
    info: ReceiversInfo = read_scenario_info(reader, ReceiversInfo)
    if info.v2x.security == "none":
        return None
    attacked = {label.number for label in read_labels(bag)} if has_labels(bag) else set()
    accepted, others_accepted = 0, 0
    why, others_why = Counter[str](), Counter[str]()
    for vehicle in receiving_vehicles(reader):
        topics = VehicleTopics(vehicle)
        for message in _messages(reader, topics.true_receptions.name):
            if message.number in attacked:
                accepted += 1
            else:
                others_accepted += 1
        for message in _messages(reader, topics.rejections.name):
            (why if message.number in attacked else others_why)[message.reason] += 1
    return (
        *(name, formatted_number(accepted + why.total(), 0), formatted_number(accepted, 0)),
        *_rejected(why, accepted),
        formatted_number(others_accepted + others_why.total(), 0),
        *_rejected(others_why, others_accepted),
    )


def _rejected(why: Counter[str], accepted: int) -> tuple[str, str]:
    total = why.total()
    share = 100 * total / (total + accepted) if total + accepted else math.nan
    reasons = sorted(why.items(), key=lambda item: (-item[1], item[0]))
    return formatted_number(share, 1), ", ".join(
        f"{count:,} {reason}" for reason, count in reasons
    ) or NOTHING


def _messages(reader: BagReader, topic: str) -> Iterable[Any]:
    return (message for _, message in reader.messages(topic)) if topic in reader.topics else ()
