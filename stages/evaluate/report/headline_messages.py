"""The first screen's parts on GPS and on V2X messages: the worst attack on cards, all of them in a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.v2x import LdmMetrics, V2xRecord
from advpipe.stages.evaluate.report.headline_parts import BAD, Card, Headline, meant_by_more, meant_by_share
from advpipe.stages.evaluate.report.numbers import NO_INTERVAL, NOTHING, formatted_number
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.wording import v2x_deed

ONE_DRIVE = f"one drive, {NO_INTERVAL}"
"""In place of an interval: the values are of one drive."""


def localisation_headline(records: Sequence[LocalisationRecord]) -> Headline:
    """Of the attack with the largest error; all of them in a table."""
    known = [each for each in records if not math.isnan(each.adversarial.max_m)] or records
    worst = max(known, key=lambda each: each.adversarial.max_m)
    clean, attacked, owner = worst.clean, worst.adversarial, _owned(worst.vehicle)
    fixes = f"{worst.attacked:,} of {worst.fixes:,}"
    several = len({each.bag for each in records}) > 1
    does = (
        f"jams the GPS of {worst.vehicle}" if _is_jammed(worst) else f"feeds {worst.vehicle} false GPS fixes"
    )
    verdict = (
        f"The {'strongest ' * several}attack {does} ({fixes}) and puts the vehicle's estimate of its "
        f"position up to {_number(attacked.max_m, 1)} m off, {_number(attacked.mean_m, 1)} m in the mean; in "
        f"the clean drive it is up to {_number(clean.max_m, 1)} m off."
    )
    if not _is_jammed(worst):
        verdict += (
            " The innovation test, which compares each fix with what the vehicle expects, flags "
            f"{_number(100 * worst.detection_rate, 0)} % of the attacked fixes."
        )
    whole = worst.clean_all, worst.adversarial_all
    is_part = _number(whole[1].mean_m, 1) != _number(attacked.mean_m, 1)
    cards = (
        Card(
            "Largest position error",
            _metres(attacked.max_m),
            meant=meant_by_more(attacked.max_m, clean.max_m),
            beside=f"clean: {_metres(clean.max_m)}",
            meaning="while the GPS fixes are attacked",
        ),
        Card(
            "Mean position error",
            _metres(attacked.mean_m),
            ONE_DRIVE,
            meant=meant_by_more(attacked.mean_m, clean.mean_m),
            beside=f"clean: {_metres(clean.mean_m)}",
            meaning="while the GPS fixes are attacked",
            attacked=f"attacked or not: {_metres(whole[1].mean_m)} (clean: {_metres(whole[0].mean_m)})"
            if is_part
            else "",
        ),
        Card(
            "Attacked fixes flagged",
            _percent(worst.detection_rate),
            ONE_DRIVE,
            meant=meant_by_share(worst.detection_rate),
            beside=f"clean fixes flagged: {_percent(worst.false_alarm_rate)}",
            meaning="all attacked fixes are lost" if _is_jammed(worst) else "by the innovation test",
            term="innovation_test",
        ),
    )  # fmt: skip
    return Headline(
        verdict,
        cards,
        done=f"{fixes} GPS fixes of {worst.vehicle} {'jammed' if _is_jammed(worst) else 'changed'}",
        does=does,
        clause=f"puts {owner} estimate of its position up to {_number(attacked.max_m, 1)} m off (clean: "
        f"{_number(clean.max_m, 1)} m)",
        shown=f"{worst.bag}, with the largest error" if several else "",
        table=_localisation_table(records) if several else None,
        bag=worst.bag,
        section="localisation",
        target="GPS",
        attacks=tuple(dict.fromkeys(each.bag for each in records)),
    )


def _is_jammed(record: LocalisationRecord) -> bool:
    return 0 < record.attacked == record.lost


def _localisation_table(records: Sequence[LocalisationRecord]) -> Table:
    heads = ("attack", "vehicle", "max error m", "mean error m", "clean, max m", "flagged %")
    lines = tuple(
        (
            each.bag,
            each.vehicle,
            _number(each.adversarial.max_m, 2),
            _number(each.adversarial.mean_m, 2),
            _number(each.clean.max_m, 2),
            _number(100 * each.detection_rate, 1),
        )
        for each in records
    )
    return Table("Localisation under each GPS attack", heads, lines)


def v2x_headline(records: Sequence[V2xRecord], clean: Mapping[str, V2xRecord]) -> Headline:
    """Of the attack whose false messages are flagged least; all of them in a table. clean: by vehicle."""
    known = [each for each in records if not math.isnan(each.ours.recall)] or records
    worst = min(known, key=lambda each: (each.ours.recall, -_wrong(each.ldm)))
    owner = _owned(worst.vehicle)
    wrong, before = _wrong(worst.ldm), clean.get(worst.vehicle)
    wrong_clean = _wrong(before.ldm if before else None)
    several = len({each.bag for each in records}) > 1
    does = v2x_deed(worst.attack)
    verdict = f"The {'least detected ' * several}attack {does}. " + (
        f"Vehicles receive {worst.false_messages:,} false messages; their checks flag "
        f"{_percent(worst.ours.recall)} of these, the baseline's (CaTCH) {_percent(worst.baseline.recall)}."
        if worst.false_messages
        else "No vehicle with a recorder receives a false message."
    )
    verdict += (
        f" Of the entries in {owner} Local Dynamic Map, its record of the traffic around it, "
        f"{_number(wrong, 1)} are wrong in the mean; in the clean drive {_number(wrong_clean, 1)}."
    )
    return Headline(
        verdict,
        (*(_flag_cards(worst) if worst.false_messages else _loss_cards(worst)), _map_card(worst, before)),
        done=f"{worst.false_messages:,} false messages received" if worst.false_messages else "",
        does=does,
        clause=f"makes {_number(wrong, 1)} entries of {owner} Local Dynamic Map, its record of the traffic "
        f"around it, wrong in the mean (clean: {_number(wrong_clean, 1)})",
        shown=f"{worst.bag}, whose messages are flagged least" if several else "",
        table=_v2x_table(records) if several else None,
        bag=worst.bag,
        section="v2x",
        target="V2X messages",
        attacks=tuple(dict.fromkeys(each.bag for each in records)),
    )


def _flag_cards(worst: V2xRecord) -> tuple[Card, ...]:
    return (
        Card(
            "False messages flagged",
            _percent(worst.ours.recall),
            ONE_DRIVE,
            meant=meant_by_share(worst.ours.recall),
            beside=f"baseline (CaTCH's checks): {_percent(worst.baseline.recall)}",
            meaning=f"of {worst.false_messages:,}: recall of the misbehaviour detector",
            term="false message",
        ),
        Card(
            "Flagged messages that are false",
            _percent(worst.ours.precision),
            ONE_DRIVE,
            meant=meant_by_share(worst.ours.precision),
            beside=f"baseline (CaTCH's checks): {_percent(worst.baseline.precision)}",
            meaning="precision of the misbehaviour detector",
            term="false message",
        ),
    )


def _loss_cards(worst: V2xRecord) -> tuple[Card, ...]:
    return (
        Card(
            "Honest messages received",
            _percent(worst.honest_delivered),
            ONE_DRIVE,
            meant=meant_by_more(1 - worst.honest_delivered, 1 - worst.honest_delivered_clean),
            beside=f"clean: {_percent(worst.honest_delivered_clean)}",
            meaning=f"by {worst.vehicle}, of those sent within 300 m",
            term="delivered",
        ),
        Card(
            "Missed dangers",
            f"{worst.warning.misses:,}",
            meant=BAD if worst.warning.misses else "",
            beside=f"false alarms: {worst.warning.false_alarms:,}",
            meaning=f"of {worst.warning.dangers:,}: {_owned(worst.vehicle)} collision warning stays silent",
            term="warning",
        ),
    )


def _map_card(worst: V2xRecord, clean: V2xRecord | None) -> Card:
    attacked = _wrong(worst.ldm_attacked)
    return Card(
        "Wrong entries of the map",
        _number(_wrong(worst.ldm), 1),
        ONE_DRIVE,
        meant=meant_by_more(_wrong(worst.ldm), _wrong(clean.ldm if clean else None)),
        beside=f"clean: {_number(_wrong(clean.ldm if clean else None), 1)}",
        meaning=f"false, missing or displaced in {_owned(worst.vehicle)} Local Dynamic Map (mean)",
        term="false, missing, displaced",
        attacked=f"while messages are attacked: {_number(attacked, 1)} (clean: "
        f"{_number(_wrong(worst.ldm_attacked_clean), 1)})"
        if _number(attacked, 1) not in (NOTHING, _number(_wrong(worst.ldm), 1))
        else "",
    )


def _v2x_table(records: Sequence[V2xRecord]) -> Table:
    heads = ("attack", "receiver", "false messages", "flagged %", "precision %", "F1", "false map entries")
    lines = tuple(
        (
            each.bag,
            each.vehicle,
            f"{each.false_messages:,}",
            _number(100 * each.ours.recall, 1),
            _number(100 * each.ours.precision, 1),
            _number(each.ours.f1, 3),
            _number(each.ldm.false_entries, 1),
        )
        for each in records
    )
    return Table("False messages of each attack", heads, lines)


def _wrong(ldm: LdmMetrics | None) -> float:
    return math.nan if ldm is None else ldm.false_entries + ldm.missing + ldm.displaced


def _owned(vehicle: str) -> str:
    return f"{vehicle}'s"


def _number(value: float, digits: int) -> str:
    return formatted_number(value, digits)


def _metres(value: float) -> str:
    return formatted_number(value, 2, " m")


def _percent(share: float) -> str:
    text = formatted_number(100 * share, 1)
    return text if text == NOTHING else f"{text} %"
