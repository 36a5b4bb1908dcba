"""The first screen's parts on CPMs and DENMs: what false ones do to vehicles that hear them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from advpipe.pipeline.results.collective_perception import CollectivePerceptionRecord
from advpipe.pipeline.results.v2x import V2xRecord
from advpipe.pipeline.results.v2x_security import DenmRecord, SecurityRecord
from advpipe.stages.evaluate.report.headline_messages import ONE_DRIVE
from advpipe.stages.evaluate.report.headline_parts import (
    BAD,
    Card,
    Headline,
    meant_by_more,
    meant_by_share,
)
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number
from advpipe.stages.evaluate.report.report import Report

CLEAN = "clean"


def heard_headlines(report: Report) -> Iterator[Headline]:
    """One on CPMs and one on DENMs, where vehicles accept false ones; or one that says that none do.

    Attacks on CAMs, which have a headline of their own, get none here.
    """
    reports, warnings = report.listed(CollectivePerceptionRecord), report.listed(DenmRecord)
    false_reports = [each for each in reports if each.attacked or each.silent]
    false_warnings = [each for each in warnings if each.false_messages]
    if false_reports:
        yield cpm_headline(false_reports, [each for each in reports if each.bag == CLEAN])
    if false_warnings:
        yield denm_headline(false_warnings, [each for each in warnings if each.bag == CLEAN])
    drives = [each for each in report.listed(V2xRecord) if each.attack]
    if drives and not false_reports and not false_warnings and not any(each.attacks for each in drives):
        yield _unheard(drives, report.listed(SecurityRecord))


def cpm_headline(
    records: Sequence[CollectivePerceptionRecord], clean: Sequence[CollectivePerceptionRecord]
) -> Headline:
    """Of the attack that adds most false objects and hides most road users."""
    before = {each.vehicle: each for each in clean}
    worst = max(records, key=lambda each: _harm(each, before.get(each.vehicle)))
    was = before.get(worst.vehicle)
    false, false_before = worst.heard_false, was.heard_false if was else math.nan
    known, known_before = worst.known_with_cpms, was.known_with_cpms if was else math.nan
    several = len({each.bag for each in records}) > 1
    does = "falsifies the objects that stations report in CPMs"
    clause = (
        f"makes {_percent(false)} of the objects that {worst.vehicle} hears of false (clean: "
        f"{_percent(false_before)}), and leaves it {_percent(known)} of the road users that its LiDARs do "
        f"not see (clean: {_percent(known_before)})"
    )
    return Headline(
        f"The {'strongest ' * several}attack {does}. It {clause}.",
        (
            Card(
                "Heard objects that do not exist",
                _percent(false),
                ONE_DRIVE,
                meant=meant_by_more(false, false_before),
                beside=f"clean: {_percent(false_before)}",
                meaning=f"of {worst.heard:,} that {worst.vehicle} hears of in CPMs",
                term="collective_perception",
            ),
            Card(
                "Unseen road users known",
                _percent(known),
                ONE_DRIVE,
                meant=meant_by_more(1 - known, 1 - known_before),
                beside=f"clean: {_percent(known_before)}; by CAMs alone: {_percent(worst.known_by_cams)}",
                meaning=f"of {worst.unseen:,} that its own LiDARs do not see",
                term="collective_perception",
            ),
            Card(
                "False objects in free space",
                _percent(worst.free_space_tpr),
                ONE_DRIVE,
                meant=meant_by_share(worst.free_space_tpr),
                beside=f"honest objects: {_percent(worst.free_space_fpr)}",
                meaning=f"of {worst.attacked:,}: the own LiDAR sees through them",
                term="cpm_checks",
            ),
        ),
        done="false objects in CPMs",
        does=does,
        clause=clause,
        shown=f"{worst.bag}, with the largest effect" if several else "",
        bag=worst.bag,
        section="collective_perception",
        target="CPMs",
        attacks=tuple(dict.fromkeys(each.bag for each in records)),
    )


def denm_headline(records: Sequence[DenmRecord], clean: Sequence[DenmRecord]) -> Headline:
    """Of the attack with the most false and suppressed events."""
    worst = max(records, key=lambda each: each.false_events + each.suppressed)
    was = next((each for each in clean if each.vehicle == worst.vehicle), None)
    known_before = f"{was.known:,}" if was else NOTHING
    several = len({each.bag for each in records}) > 1
    does = "sends false warnings (DENMs)"
    clause = (
        f"warns {worst.vehicle} of {worst.false_events:,} events that do not exist, and ends "
        f"{worst.suppressed:,} true ones for it; of {worst.events:,} true events nearby it learns of "
        f"{worst.known:,} (clean: {known_before})"
    )
    return Headline(
        f"The {'strongest ' * several}attack {does}. It {clause}.",
        (
            Card(
                "False events",
                f"{worst.false_events:,}",
                meant=BAD if worst.false_events else "",
                meaning=f"{worst.vehicle} is warned of them",
                term="false, suppressed events",
            ),
            Card(
                "Suppressed events",
                f"{worst.suppressed:,}",
                meant=BAD if worst.suppressed else "",
                beside=f"true events known: {worst.known:,} of {worst.events:,}",
                meaning=f"ended for {worst.vehicle} while they lasted",
                term="false, suppressed events",
            ),
            Card(
                "False warnings flagged",
                _percent(worst.recall),
                ONE_DRIVE,
                meant=meant_by_share(worst.recall),
                beside=f"honest ones: {_percent(worst.false_positive_rate)}",
                meaning=f"of {worst.false_messages:,} DENMs, by two simple checks",
                term="false, suppressed events",
            ),
        ),
        done=f"{worst.false_messages:,} false DENMs received",
        does=does,
        clause=clause,
        shown=f"{worst.bag}, with most of such events" if several else "",
        bag=worst.bag,
        section="denm",
        target="DENMs",
        attacks=tuple(dict.fromkeys(each.bag for each in records)),
    )


def _unheard(drives: Sequence[V2xRecord], security: Sequence[SecurityRecord]) -> Headline:
    """Of attacks on CPMs and DENMs of which no vehicle accepts a message."""
    clause = "reaches no vehicle with a recorder"
    received = [each for each in security if each.attack and each.received]
    if received:
        rejected = sum(each.received - each.accepted for each in received)
        total = sum(each.received for each in received)
        clause = f"changes nothing that vehicles believe: they reject {rejected:,} of its {total:,} messages"
    return Headline(
        f"The attack {clause}.",
        (),
        clause=clause,
        bag=drives[0].bag,
        section="security" if received else "v2x",
        target="V2X messages",
        attacks=tuple(dict.fromkeys(each.bag for each in drives)),
    )


def _harm(record: CollectivePerceptionRecord, clean: CollectivePerceptionRecord | None) -> float:
    if clean is None:
        return record.heard_false
    changes = record.heard_false - clean.heard_false, clean.known_with_cpms - record.known_with_cpms
    return sum(change for change in changes if not math.isnan(change))


def _percent(share: float) -> str:
    text = formatted_number(100 * share, 1)
    return text if text == NOTHING else f"{text} %"
