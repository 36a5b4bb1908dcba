"""Transfer: attacks made against one detector, as others see them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from advpipe.pipeline.results.records import TransferRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import NOTHING, with_interval
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
    groups: dict[str, list[TransferRecord]] = {}
    for record in records:
        parameters = json.dumps(record.parameters, sort_keys=True)
        groups.setdefault(f"{_title(record)} {parameters}", []).append(record)
    yield ReportSection(
        "transfer",
        "Transfer between detectors",
        "mAP ratio in percent with its 95 % interval: a line for each detector that was attacked, a column "
        f"for each that looks. A star marks the one that was attacked itself (white box). {WHITE_BOX}",
        tuple(_matrix(group) for group in groups.values()),
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


def _title(record: TransferRecord) -> str:
    return attack_title(record)


def _matrix(records: Sequence[TransferRecord]) -> Table:
    """Two bags against one detector take a line each, by the bag's name."""
    seen = list(dict.fromkeys(record.evaluated_with for record in records))
    bags = dict.fromkeys((record.attacked_against, record.bag) for record in records)
    attacked = [against for against, _ in bags]
    lines = []
    for against, bag in bags:
        cells = {record.evaluated_with: _cell(record) for record in records if record.bag == bag}
        title = f"{against} ({bag})" if attacked.count(against) > 1 else against
        lines.append((title, *(cells.get(name, NOTHING) for name in seen)))
    heads = ("attacked against", *(f"evaluated with {name}" for name in seen))
    return Table(_title(records[0]), heads, tuple(lines))


def _cell(record: TransferRecord) -> str:
    if record.map_ratio_percent is None:
        return NOTHING
    star = " *" if record.is_white_box else ""
    return with_interval(record.map_ratio_percent, record.map_ratio_ci95, 1) + star
