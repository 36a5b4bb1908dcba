"""The first screen of a report: what was done, how bad it is in a sentence, and the main values on cards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.v2x import V2xRecord
from advpipe.stages.evaluate.report.headline_detection import clean_headline, detection_headline
from advpipe.stages.evaluate.report.headline_parts import Card, Headline
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import attack_name
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.wording import changed_points

MOST_NAMES = 3


@dataclass(frozen=True)
class FirstScreen:
    """title: what was done. about: on what, in a line. headlines: one for each family of attacks."""

    title: str
    about: str
    headlines: tuple[Headline, ...]


def first_screen(report: Report) -> FirstScreen:
    """What a reader sees first; the clean results only where nothing was attacked."""
    headlines = tuple(_headlines(report))
    if not headlines and report.results:
        headlines = (clean_headline(report.results[0]),)
    return FirstScreen(_title(report, headlines), _about(report), headlines)


def _headlines(report: Report) -> Iterator[Headline]:
    if any(row.attacked for row in report.results):
        yield detection_headline(report)
    if positions := report.listed(LocalisationRecord):
        yield _localisation_headline(positions)
    if drives := [each for each in report.listed(V2xRecord) if each.attack]:
        yield _v2x_headline(drives, report)


def _title(report: Report, headlines: tuple[Headline, ...]) -> str:
    drive = report.origin.clean.scenario or report.origin.clean.bag
    attacked = [row for row in report.results if row.attacked]
    bags = {row.bag for row in attacked}
    others = [name for headline in headlines for name in headline.attacks if name not in bags]
    names = list(dict.fromkeys([*(attack_name(row.attack) for row in attacked), *others]))
    if not names:
        detectors = ", ".join(each.name for each in report.origin.detectors)
        return f"What detector {detectors} finds on the drive {drive}" if detectors else f"The drive {drive}"
    *first, last = (headline.target for headline in headlines)
    targets = f"{', '.join(first)} and {last}" if first else last
    title = f"{len(names)} attacks on {targets}" if len(names) > 1 else f"Attack {names[0]}"
    if len(names) == 1 and len(headlines) > 1:
        title = f"Coordinated attack on {targets}: {names[0].partition(',')[0].replace('+', ' + ')}"
    elif len(attacked) == 1 and len(names) == 1 and (done := changed_points(attacked[0])):
        title += f": {done.passive}"
    return f"{title}, drive {drive}"


def _about(report: Report) -> str:
    """The detectors, the bags and the frames."""
    parts = [f"clean bag {report.origin.clean.bag}"]
    compared = [each.bag for each in report.origin.compared if each.sha256]
    if 0 < len(compared) <= MOST_NAMES:
        parts.append(f"adversarial bag{'s' if len(compared) > 1 else ''} {', '.join(compared)}")
    elif compared:
        parts.append(f"{len(compared)} adversarial bags")
    if report.results:
        detectors = [f"{each.name} ({', '.join(each.classes)})" for each in report.origin.detectors]
        parts.insert(0, f"detector{'s' if len(detectors) > 1 else ''} {', '.join(detectors)}")
        counts = report.results[0].counts
        parts.append(f"{counts.frames:,} frames with {counts.objects:,} evaluated objects")
    return "; ".join(parts)


def _localisation_headline(records: list[LocalisationRecord]) -> Headline:
    """Of the attack with the largest error; all of them in a table."""
    known = [each for each in records if each.adversarial.max_m == each.adversarial.max_m] or records
    worst = max(known, key=lambda each: each.adversarial.max_m)
    clean, attacked = worst.clean, worst.adversarial
    verdict = (
        f"Attack {worst.bag} puts {worst.vehicle}'s position estimate up to "
        f"{_number(attacked.max_m, 1)} m off, {_number(attacked.mean_m, 1)} m in the mean; in the clean "
        f"drive it is up to {_number(clean.max_m, 1)} m off. The innovation test flags "
        f"{_number(100 * worst.detection_rate, 0)} % of the attacked fixes."
    )
    cards = (
        Card("Largest position error", _metres(attacked.max_m), beside=f"clean: {_metres(clean.max_m)}"),
        Card("Mean position error", _metres(attacked.mean_m), beside=f"clean: {_metres(clean.mean_m)}"),
        Card(
            "Attacked fixes flagged",
            f"{_number(100 * worst.detection_rate, 1)} %",
            beside=f"clean fixes flagged: {_number(100 * worst.false_alarm_rate, 2)} %",
            meaning="by the innovation test",
        ),
    )  # fmt: skip
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
    table = Table("Localisation under each GPS attack", heads, lines) if len(records) > 1 else None
    return Headline(
        verdict, cards, table, "localisation", "GPS", tuple(dict.fromkeys(each.bag for each in records))
    )


def _v2x_headline(records: list[V2xRecord], report: Report) -> Headline:
    """Of the attack whose false messages are flagged least; all of them in a table."""
    known = [each for each in records if each.ours.recall == each.ours.recall] or records
    worst = min(known, key=lambda each: (each.ours.recall, -each.ldm.false_entries))
    clean = {each.vehicle: each for each in report.listed(V2xRecord) if not each.attack}
    before = clean[worst.vehicle].ldm if worst.vehicle in clean else None
    wrong = worst.ldm.false_entries + worst.ldm.missing + worst.ldm.displaced
    wrong_clean = before.false_entries + before.missing + before.displaced if before else float("nan")
    flagged = (
        f"Of the {worst.false_messages:,} false messages that vehicles receive from attack {worst.attack}, "
        f"the receivers' checks flag {_percent(worst.ours.recall)} (baseline: "
        f"{_percent(worst.baseline.recall)})."
        if worst.false_messages
        else "No instrumented vehicle receives a false message here."
    )
    verdict = (
        f"{flagged} {worst.vehicle}'s Local Dynamic Map holds "
        f"{_number(wrong, 1)} wrong entries in the mean, in the clean drive {_number(wrong_clean, 1)}."
    )
    cards = (
        Card(
            "False messages flagged",
            _percent(worst.ours.recall),
            beside=f"baseline: {_percent(worst.baseline.recall)}",
            meaning="recall of the misbehaviour detection",
        ),
        Card(
            "Flagged messages that are false",
            _percent(worst.ours.precision),
            beside=f"baseline: {_percent(worst.baseline.precision)}",
            meaning="precision of the misbehaviour detection",
        ),
        Card(
            "Wrong entries of the map",
            _number(wrong, 1),
            beside=f"clean: {_number(wrong_clean, 1)}",
            meaning=f"false, missing and displaced entries of {worst.vehicle}'s Local Dynamic Map (mean)",
        ),
    )  # fmt: skip
    heads = ("attack", "receiver", "false messages", "flagged %", "precision %", "F1", "false map entries")
    lines = tuple(
        (
            each.bag,
            each.vehicle,
            f"{each.false_messages:,}",
            _percent(each.ours.recall),
            _percent(each.ours.precision),
            _number(each.ours.f1, 3),
            _number(each.ldm.false_entries, 1),
        )
        for each in records
    )
    table = Table("False messages of each attack", heads, lines) if len(records) > 1 else None
    return Headline(
        verdict, cards, table, "v2x", "V2X messages", tuple(dict.fromkeys(each.bag for each in records))
    )


def _number(value: float, digits: int) -> str:
    return formatted_number(value, digits)


def _metres(value: float) -> str:
    return formatted_number(value, 2, " m")


def _percent(share: float) -> str:
    text = formatted_number(100 * share, 1)
    return text if text == NOTHING else f"{text} %"
