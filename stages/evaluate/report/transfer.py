"""Transfer: attacks made against one detector, evaluated with others."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence

from advpipe.pipeline.results.records import TransferRecord
from advpipe.pipeline.results.row import FrameCounts, ResultRow
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import (
    NOTHING,
    formatted_ratio,
    interval,
    shown_interval,
)
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import ReportSection, Table
from advpipe.stages.evaluate.report.wording import WHITE_BOX


def transfer_section(summaries: Sequence[Summary]) -> Iterator[ReportSection]:
    """A matrix for each attack, attacked-against by evaluated-with, where more than one detector is in it."""
    records = [
        _record(summary.result, against)
        for summary in summaries
        if (against := summary.result.attack.attacked_against)
    ]
    if len({record.evaluated_with for record in records}) < 2 and all(each.is_white_box for each in records):
        return
    counts = {(each.result.bag, each.result.detector): each.result.counts for each in summaries}
    groups: dict[str, list[TransferRecord]] = {}
    for record in records:
        parameters = json.dumps(record.parameters, sort_keys=True)
        groups.setdefault(f"{attack_title(record)} {parameters}", []).append(record)
    yield ReportSection(
        "transfer",
        "Transfer between detectors",
        "mAP ratio in percent with its 95 % interval: a line for each detector that an attack was made "
        "against, a column for each detector that is evaluated. A star marks a detector that was attacked "
        f"itself (white box). {WHITE_BOX}",
        tuple(_matrix(group, counts) for group in groups.values()),
        records=tuple(records),
    )


def _record(result: ResultRow, attacked_against: str) -> TransferRecord:
    attack, attacked = result.attack, result.attacked
    return TransferRecord(
        bag=result.bag,
        attack=attack.attack,
        recipe=attack.recipe,
        parameter=attack.parameter,
        value=attack.value,
        parameters=attack.parameters,
        attacked_against=attacked_against,
        frames=result.counts.frames,
        evaluated_with=result.detector,
        is_white_box=attack.is_white_box,
        map_clean=result.clean.means["strict"].map_r40,
        map_ratio_percent=attacked.map_ratio_percent if attacked else None,
        map_ratio_ci95=attacked.map_ratio_ci95 if attacked else None,
    )


def _matrix(records: Sequence[TransferRecord], counts: Mapping[tuple[str, str], FrameCounts]) -> Table:
    """Two bags against one detector take a line each, by the bag's name."""
    seen = list(dict.fromkeys(record.evaluated_with for record in records))
    bags = dict.fromkeys((record.attacked_against, record.bag) for record in records)
    attacked = [against for against, _ in bags]
    lines = []
    for against, bag in bags:
        cells = {
            record.evaluated_with: _cell(record, counts[record.bag, record.evaluated_with])
            for record in records
            if record.bag == bag
        }
        title = f"{against} ({bag})" if attacked.count(against) > 1 else against
        lines.append((title, *(cells.get(name, NOTHING) for name in seen)))
    heads = ("attacked against", *(f"evaluated with {name}" for name in seen))
    return Table(attack_title(records[0]), heads, tuple(lines))


def _cell(record: TransferRecord, counts: FrameCounts) -> str:
    if record.map_ratio_percent is None:
        return NOTHING
    star = " *" if record.is_white_box else ""
    bounds = shown_interval(record.map_ratio_ci95, counts)
    brackets = f" ({interval(bounds)})" if bounds else ""
    return formatted_ratio(record.map_ratio_percent, record.map_clean, 1) + brackets + star
