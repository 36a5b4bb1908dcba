"""Transfer: attacks made against one detector, as others see them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import NOTHING, with_interval
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import Section, Table
from advpipe.stages.evaluate.report.wording import WHITE_BOX


def transfer_section(summaries: Sequence[Summary]) -> Iterator[Section]:
    """A matrix for each attack, attacked-against by evaluated-with, where more than one detector is in it."""
    records = [_record(summary) for summary in summaries if summary.row["attacked_against"]]
    if len({record["evaluated_with"] for record in records}) < 2 and all(r["is_white_box"] for r in records):
        return
    groups: dict[str, list[Row]] = {}
    for record in records:
        parameters = json.dumps(record["parameters"], sort_keys=True)
        groups.setdefault(f"{attack_title(record)} {parameters}", []).append(record)
    yield Section(
        "transfer",
        "Transfer between detectors",
        "mAP ratio in percent with its 95 % interval: a line for each detector that was attacked, a column "
        f"for each that looks. A star marks the one that was attacked itself (white box). {WHITE_BOX}",
        tuple(_matrix(group) for group in groups.values()),
        records=tuple(records),
    )


def _record(summary: Summary) -> Row:
    row = summary.row
    keys = ("bag", "attack", "recipe", "parameter", "value", "parameters", "attacked_against", "frames")
    return {
        **{key: row[key] for key in keys},
        "evaluated_with": row["detector"],
        "is_white_box": row["is_white_box"],
        "map_clean": row["map_clean"],
        "map_ratio_percent": row["map_ratio_percent"],
        "map_ratio_ci95": row["map_ratio_ci95"],
    }


def _matrix(records: Sequence[Row]) -> Table:
    """Two bags against one detector take a line each, by the bag's name."""
    seen = list(dict.fromkeys(record["evaluated_with"] for record in records))
    bags = {(record["attacked_against"], record["bag"]) for record in records}
    attacked = [against for against, _ in bags]
    lines = []
    for against, bag in dict.fromkeys((record["attacked_against"], record["bag"]) for record in records):
        cells = {record["evaluated_with"]: _cell(record) for record in records if record["bag"] == bag}
        title = f"{against} ({bag})" if attacked.count(against) > 1 else str(against)
        lines.append((title, *(cells.get(name, NOTHING) for name in seen)))
    heads = ("attacked against", *(f"evaluated with {name}" for name in seen))
    return Table(attack_title(records[0]), heads, tuple(lines))


def _cell(record: Row) -> str:
    if record["map_ratio_percent"] is None:
        return NOTHING
    star = " *" if record["is_white_box"] else ""
    return with_interval(record["map_ratio_percent"], record["map_ratio_ci95"], 1) + star
