"""The first screen's part on detection: the strongest attack on cards, all of them in a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.metrics import CleanMeans
from advpipe.pipeline.results.records import EffectRecord
from advpipe.pipeline.results.row import RANDOM_BEST, FrameCounts, ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.effect import ALL, ATTACKED
from advpipe.stages.evaluate.report.headline_parts import BAD, Card, Headline
from advpipe.stages.evaluate.report.numbers import (
    NO_INTERVAL,
    formatted_number,
    interval,
    interval_cell,
    interval_of_blocks,
    no_interval,
    short_name,
    undefined_ratio,
)
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.wording import TO_BEAT, changed_points

Value = Callable[[EffectRecord], float]

SAME_PERCENT = 99.0
"""From this mAP ratio on, nothing of note has happened to the detector."""


def strongest_attack(rows: Sequence[ResultRow]) -> ResultRow:
    """The one of these attacked rows, of the first's detector, with the lowest strict mAP ratio."""
    own = of_first_detector(rows)
    return min(own, key=lambda row: _last(row.attacked.map_ratio_percent if row.attacked else math.nan))


def of_first_detector(rows: Sequence[ResultRow]) -> list[ResultRow]:
    return [row for row in rows if row.detector == rows[0].detector]


def detection_headline(report: Report) -> Headline:
    """The effect of the strongest attack on detection, by the detector that was named first."""
    rows = [each for each in report.results if each.attacked]
    row, attack_count = strongest_attack(rows), len(of_first_detector(rows))
    effects = _effects_of(report, row)
    attack = _of(effects, "adv")
    found = (
        _ratio_card("mAP ratio, strict", row, effects, "strict", _strict_ratio),
        _ratio_card("mAP ratio, loose", row, effects, "loose", _loose_ratio),
        _lost_card(row, attack, effects),
    )
    over_attacked = [each for each in _effects_of(report, row, ATTACKED) if each.condition == "adv"]
    cards = tuple(
        _with_attacked_frames(card, value, over_attacked)
        for card, value in zip(found, (_strict_ratio, _loose_ratio, _lost_share), strict=True)
    )
    is_one_of_several = len(rows) > attack_count
    leaves = f"leaves the {_detector(row, is_one_of_several)} {_left(attack)}"
    return Headline(
        _verdict(row, effects, leaves, attack_count),
        cards,
        does=done.does if (done := changed_points(row)) else "",
        clause=leaves,
        shown=_shown(row, attack_count, is_one_of_several),
        table=_table(report, rows) if len(rows) > 1 else None,
        bag=row.bag,
        section="attack_effects",
        target="LiDAR clouds",
    )


def clean_headline(rows: Sequence[ResultRow]) -> Headline:
    """How well the detector sees where nothing was attacked; of several, the one that was named first."""
    row = rows[0]
    detector = _detector(row, len(rows) > 1)
    counts, means = row.counts, row.clean.means
    strict, loose = means["strict"], means["loose"]
    share = 100 * counts.objects_found_clean / counts.objects if counts.objects else math.nan
    verdict = (
        f"The {detector} finds {counts.objects_found_clean:,} of {counts.objects:,} evaluated objects and "
        f"reports {counted(counts.false_positives_clean, 'false positive')} in "
        f"{counted(counts.frames, 'frame')}. Its mAP is "
        f"{formatted_number(strict.map_r40, 3)} at strict and {formatted_number(loose.map_r40, 3)} at loose "
        f"overlap, over {', '.join(counts.classes_in_map)}."
    )
    cards = (
        _map_card("mAP, strict", strict, counts, "map"),
        _map_card("mAP, loose", loose, counts, "iou"),
        Card(
            "Objects found",
            f"{formatted_number(share, 1)} %",
            meaning=f"{counts.objects_found_clean:,} of {counts.objects:,}, at loose overlap and a score "
            f"of at least {counts.working_score:.2f}",
            beside=f"false positives: {counts.false_positives_clean:,}",
            term="lost",
        ),
    )  # fmt: skip
    return Headline(verdict, cards, section="clean")


def _strict_ratio(each: EffectRecord) -> float:
    return each.map_ratio_percent


def _loose_ratio(each: EffectRecord) -> float:
    return each.map_loose_ratio_percent


def _lost_share(each: EffectRecord) -> float:
    return each.lost_percent


def _with_attacked_frames(card: Card, value: Value, records: Sequence[EffectRecord]) -> Card:
    """The card with the value over the attacked frames alone, where the attack left some alone."""
    if not records:
        return card
    (record,) = records
    frames = counted(record.frame_count, "attacked frame")
    text = f"over the {frames} alone: {_percent(value(record))}"
    return replace(card, attacked=text)


def _effects_of(report: Report, row: ResultRow, frames: str = ALL) -> list[EffectRecord]:
    about = (row.bag, row.detector, frames)
    return [each for each in report.listed(EffectRecord) if (each.bag, each.detector, each.frames) == about]


def _of(effects: Sequence[EffectRecord], condition: str) -> EffectRecord:
    return next(each for each in effects if each.condition == condition)


def _to_beat(effects: Sequence[EffectRecord]) -> EffectRecord | None:
    """That of baseline `random_best`; None where it was not scored."""
    return next((each for each in effects if each.condition == RANDOM_BEST), None)


def _detector(row: ResultRow, is_one_of_several: bool) -> str:
    return f"detector {short_name(row.detector)}" if is_one_of_several else "detector"


def _shown(row: ResultRow, attack_count: int, is_one_of_several: bool) -> str:
    """What the cards are about, where there is more than one attack or detector."""
    if attack_count == 1 and not is_one_of_several:
        return ""
    title = attack_title(row.attack)
    if is_one_of_several:
        title += f" on {_detector(row, is_one_of_several)}"
    return f"{title}, the strongest of {attack_count} attacks" if attack_count > 1 else title


def _verdict(row: ResultRow, effects: Sequence[EffectRecord], leaves: str, attack_count: int) -> str:
    attack = _of(effects, "adv")
    done = changed_points(row)
    subject = done.active if done else f"Attack {attack_title(row.attack)}"
    if attack_count > 1:
        subject = f"{subject[0].lower()}{subject[1:]}"
        subject = f"The strongest of {attack_count} attacks: {subject}"
    if math.isnan(attack.map_ratio_percent):
        return f"{subject}: the mAP ratio is {undefined_ratio(row.clean.means['strict'].map_r40)}."
    text = f"{subject} {leaves}"
    if random := _to_beat(effects):
        text += (
            f"; the same budget spent at random, {_best_of(row)}, leaves "
            f"{_percent(random.map_ratio_percent)} and {_percent(random.map_loose_ratio_percent)}"
        )
    return text + "."


def _left(attack: EffectRecord) -> str:
    return (
        f"{_percent(attack.map_ratio_percent)} of its average precision at strict overlap and "
        f"{_percent(attack.map_loose_ratio_percent)} at loose overlap"
    )


def _ratio_card(
    title: str, row: ResultRow, effects: Sequence[EffectRecord], criterion: str, value: Value
) -> Card:
    attack, random = _of(effects, "adv"), _to_beat(effects)
    if math.isnan(value(attack)):
        text = undefined_ratio(row.clean.means[criterion].map_r40)
        return Card(title, text.partition(":")[0], meaning=text, term="map_ratio")
    return Card(
        title,
        _percent(value(attack)),
        _bounds(row, attack, criterion),
        _beside(random, value, criterion),
        "of the clean mAP is left; lower is worse for the detector",
        "map_ratio" if criterion == "strict" else "iou",
        compared=_name(row) if random else "",
        meant=BAD if value(attack) < SAME_PERCENT else "",
    )


def _lost_card(row: ResultRow, attack: EffectRecord, effects: Sequence[EffectRecord]) -> Card:
    random = _to_beat(effects)
    return Card(
        "Objects lost",
        _percent(attack.lost_percent),
        _bounds(row, attack, "lost"),
        _beside(random, _lost_share, "lost"),
        f"{attack.lost_objects:,} of {attack.found_clean:,} found objects are not found any more; "
        f"{attack.displaced_objects:,} more are displaced",
        "lost",
        compared=_name(row) if random else "",
        meant=BAD if attack.lost_objects else "",
    )


def _interval_of(each: EffectRecord, what: str) -> str:
    bounds = {"strict": each.map_ratio_ci95, "loose": each.map_loose_ratio_ci95, "lost": each.lost_ci95}[what]
    shown = interval_of_blocks(bounds, each.blocks)
    return interval(shown) if shown else ""


def _bounds(row: ResultRow, each: EffectRecord, what: str) -> str:
    """The interval, or why there is none."""
    shown = _interval_of(each, what)
    return f"95 % interval {shown}" if shown else no_interval(row.counts)


def _beside(baseline: EffectRecord | None, value: Value, what: str) -> str:
    if baseline is None:
        return ""
    return f"random baseline: {_percent(value(baseline))}" + _in_brackets(baseline, what)


def _in_brackets(each: EffectRecord, what: str) -> str:
    shown = _interval_of(each, what)
    return f" ({shown})" if shown else ""


def _map_card(title: str, mean: CleanMeans, counts: FrameCounts, term: str) -> Card:
    cell = interval_cell(mean.map_r40_ci95, counts, 3)
    bounds = cell if cell.startswith(NO_INTERVAL) else f"95 % interval {cell}"
    return Card(title, formatted_number(mean.map_r40, 3), bounds, term=term)


def _name(row: ResultRow) -> str:
    """Of the baseline to beat, such as `random-best, 13 tries`; with fewer than the attack, it says so."""
    made_by = row.attack
    title = baseline_title(RANDOM_BEST, made_by.baseline_tries)
    is_short = made_by.query_budget is not None and made_by.baseline_tries < made_by.query_budget
    return f"{title} (the attack {made_by.query_budget})" if is_short else title


def _best_of(row: ResultRow) -> str:
    """The tries of the baseline to beat, in words; with fewer than the attack, it says so."""
    tries, budget = row.attack.baseline_tries, row.attack.query_budget
    text = f"best of {counted(tries, 'try', 'tries')}" if tries else "best of its tries"
    return f"{text} (the attack: best of {budget})" if budget is not None and tries < budget else text


def _table(report: Report, rows: Sequence[ResultRow]) -> Table:
    """The cards' values of each attack."""
    several = len({row.detector for row in rows}) > 1
    heads = (
        "attack", *(("detector",) if several else ()), "mAP ratio, strict %", "95 %", "mAP ratio, loose %",
        "95 %", "lost %", "lost", "displaced", f"{TO_BEAT}, strict %", "loose %", "lost %",
    )  # fmt: skip
    lines = []
    for row in rows:
        effects = _effects_of(report, row)
        attack = _of(effects, "adv")
        random = _to_beat(effects)
        lines.append(
            (
                attack_title(row.attack),
                *((short_name(row.detector),) if several else ()),
                formatted_number(attack.map_ratio_percent, 1),
                _interval_of(attack, "strict") or no_interval(row.counts),
                formatted_number(attack.map_loose_ratio_percent, 1),
                _interval_of(attack, "loose") or no_interval(row.counts),
                formatted_number(attack.lost_percent, 1),
                f"{attack.lost_objects:,} of {attack.found_clean:,}",
                f"{attack.displaced_objects:,}",
                *(
                    formatted_number(value(random) if random else None, 1)
                    for value in (_strict_ratio, _loose_ratio, _lost_share)
                ),
            )
        )
    return Table("The main values of each attack", heads, tuple(lines))


def _percent(value: float) -> str:
    text = formatted_number(value, 1)
    return f"{text} %" if not math.isnan(value) else text


def _last(ratio: float) -> float:
    return math.inf if math.isnan(ratio) else ratio
