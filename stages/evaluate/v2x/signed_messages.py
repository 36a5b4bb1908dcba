"""What security stopped: the messages that receivers verified and rejected, attacked ones and others."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.latched import ReceiversInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles
from advpipe.pipeline.labels.messages import has_labels, read_labels
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.results.v2x_security import ReasonCount, SecurityRecord
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number
from advpipe.stages.evaluate.report.section import Formula, ReportSection, Table

HEADS = ("bag", "attack", "attacker", "credentials", "received", "accepted", "rejected %", "why")
NOTE = (
    "Messages that reached the radios of instrumented vehicles. Of an attack: those that it changed, added "
    "or delayed; the line without an attack has all others. Accepted: signed with a valid ticket, fresh and "
    "not replayed; only they reach the Local Dynamic Map and misbehaviour detection. An insider's attack is "
    "signed as true messages are, so that security does not stop it. Unknown signer: the receiver had not "
    "yet received the certificate, which stations send once a second; this happens to honest messages, too."
)
FORMULA = Formula(
    "stopped by security",
    "of the messages of an attack that reached the radios of instrumented vehicles, the share that their "
    "security entities rejected. Insider: attackers that sign with valid tickets of their own; outsider: all "
    "others",
    ("stopped", "accepted"),
    title="What security stops",
)


@dataclass
class _Fate:
    """What became of messages at receivers."""

    accepted: int = 0
    why: Counter[str] = field(default_factory=Counter)


def security_sections(clean: Path, adversarial: Sequence[Path]) -> tuple[ReportSection, ...]:
    """One section on the bags whose messages are signed; none if none are. The whole drives count."""
    bags = [(clean, "clean"), *((bag, bag_name(bag)) for bag in adversarial)]
    records = tuple(record for bag, name in bags for record in _records(BagReader(bag), bag, name))
    if not records:
        return ()
    table = Table("Security: messages that receivers verified", HEADS, tuple(map(_line, records)), NOTE)
    return (
        ReportSection(
            key="security",
            title="V2X security: what it stops and what it does not",
            lead=_lead(records),
            tables=(table,),
            records=records,
            formulas=(FORMULA,),
            terminal=(_overview(table),),
        ),
    )


def _overview(table: Table) -> Table:
    """The main columns, for a terminal."""
    heads = ("bag", "attacker", "received", "accepted", "rejected %")
    columns = [HEADS.index(head) for head in heads]
    lines = tuple(tuple(line[column] for column in columns) for line in table.lines)
    title = "Security: messages of attackers, and (–) of all others, that receivers verified"
    return Table(title, heads, lines)


def _lead(records: Sequence[SecurityRecord]) -> str:
    honest = [each for each in records if not each.attack]
    received, accepted = sum(each.received for each in honest), sum(each.accepted for each in honest)
    sentences = []
    for who in ("outsider", "insider"):
        own = [each for each in records if each.attacker == who]
        if total := sum(each.received for each in own):
            share = 100 * (1 - sum(each.accepted for each in own) / total)
            sentences.append(f"Of {who}s' messages, receivers rejected {formatted_number(share, 1)} %.")
    if received:
        share = 100 * (1 - accepted / received)
        sentences.append(f"Of messages that no attack touched, {formatted_number(share, 1)} %.")
    return " ".join(sentences)


def _records(reader: BagReader, bag: Path, name: str) -> Iterator[SecurityRecord]:
    """None for a bag without signed messages."""
    if SCENARIO_INFO.name not in reader.topics:
        return
    info: ReceiversInfo = read_scenario_info(reader, ReceiversInfo)
    if info.v2x.security == "none":
        return
    attack_of = {one.number: one.attack for one in read_labels(bag)} if has_labels(bag) else {}
    fates: defaultdict[str, _Fate] = defaultdict(_Fate)
    for vehicle in receiving_vehicles(reader):
        topics = VehicleTopics(vehicle)
        for message in _messages(reader, topics.true_receptions.name):
            fates[attack_of.get(message.number, "")].accepted += 1
        for message in _messages(reader, topics.rejections.name):
            fates[attack_of.get(message.number, "")].why[message.reason] += 1
    credentials = _credentials(reader)
    for attack in dict.fromkeys((*credentials, *sorted(fates))):
        signed_with = credentials.get(attack, "ticket") if attack else ""
        attacker = "" if not attack else "insider" if signed_with == "ticket" else "outsider"
        yield _record((name, attack, attacker, signed_with), fates[attack])


def _credentials(reader: BagReader) -> dict[str, str]:
    """What the attackers of each attack on V2X sign with; a deceived station signs with its ticket."""
    return {
        one.type: str(one.values.get("credentials", "ticket"))
        for one in reader.provenance.fields.attacks
        if one.family == "v2x"
    }


def _record(names: tuple[str, str, str, str], fate: _Fate) -> SecurityRecord:
    received = fate.accepted + fate.why.total()
    reasons = sorted(fate.why.items(), key=lambda item: (-item[1], item[0]))
    return SecurityRecord(
        *names,
        received=received,
        accepted=fate.accepted,
        stopped=fate.why.total() / received if received else math.nan,
        rejected=tuple(ReasonCount(*one) for one in reasons),
    )


def _line(record: SecurityRecord) -> tuple[str, ...]:
    return (
        *(record.bag, record.attack or NOTHING, record.attacker or NOTHING, record.credentials or NOTHING),
        formatted_number(record.received, 0),
        formatted_number(record.accepted, 0),
        formatted_number(100 * record.stopped, 1),
        ", ".join(f"{one.messages:,} {one.reason}" for one in record.rejected) or NOTHING,
    )


def _messages(reader: BagReader, topic: str) -> Iterable[Any]:
    return (message for _, message in reader.messages(topic)) if topic in reader.topics else ()
