"""Tables of what cells list: lost objects and precision by range, defences, attack checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.report.numbers import ANSWER, NOTHING, formatted_number, interval
from advpipe.stages.evaluate.report.section import Table

Record = Mapping[str, Any]


def listed_tables(cells: Sequence[Cell]) -> list[Table]:
    """Those that any cell has lines for."""
    every = (
        Table(
            "Lost and displaced objects, by range",
            (
                *("cell", "range", "found strictly", "lost strictly, %", "95 %", f"{RANDOM_BEST}, %"),
                *("found loosely", "lost loosely, %", "95 %", f"{RANDOM_BEST}, %", "displaced"),
            ),
            tuple(line for cell in cells for line in _success_lines(cell)),
        ),
        Table(
            "Strict average precision, by class and range",
            ("cell", "class", "range", "objects", "clean", "attacked", RANDOM_BEST),
            tuple(line for cell in cells for line in _precision_lines(cell)),
        ),
        Table(
            "Under defences: the mAP ratio is to clean clouds under the same defence",
            (
                *("cell", "defence", "clean mAP kept %", "ratio %", "95 %", f"{RANDOM_BEST}: ratio %"),
                *("Δ to it, points", "95 %", "significant"),
                *("loose ratio %", f"{RANDOM_BEST}: loose ratio %", "Δ, loose", "95 %", "frames"),
            ),
            tuple(line for cell in cells for line in _defence_lines(cell)),
        ),
        Table(
            "Attack checks: clouds above a threshold that clean ones set",
            ("cell", "check", "detected %", "false alarms %", "AUC", "points flagged %", "falsely %"),
            tuple(line for cell in cells for line in _check_lines(cell)),
        ),
    )
    return [table for table in every if table.lines]


def _success_lines(cell: Cell) -> Iterator[tuple[str, ...]]:
    records = cell.listed.get("attack_success", ())
    random = {each["range"]: each for each in records if each["condition"] == RANDOM_BEST}
    for place, each in enumerate(one for one in records if one["condition"] == "adv"):
        beside = random.get(each["range"], {})
        yield (
            _once(cell, place),
            each["range"],
            formatted_number(each["strict_found_clean"], 0),
            formatted_number(each["strict_attack_success_percent"], 1),
            _interval(each, "strict_attack_success_ci95"),
            formatted_number(beside.get("strict_attack_success_percent"), 1),
            formatted_number(each["found_clean"], 0),
            formatted_number(each["attack_success_percent"], 1),
            _interval(each, "attack_success_ci95"),
            formatted_number(beside.get("attack_success_percent"), 1),
            formatted_number(each["displaced"], 0),
        )


def _precision_lines(cell: Cell) -> Iterator[tuple[str, ...]]:
    by_condition: dict[tuple[str, str], dict[str, Record]] = {}
    for each in cell.listed.get("average_precision", ()):
        by_condition.setdefault((each["class"], each["stratum"]), {})[each["condition"]] = each
    for place, ((name, stratum), found) in enumerate(by_condition.items()):
        yield (
            _once(cell, place),
            name,
            stratum,
            formatted_number(found["clean"]["boxes"], 0),
            *(
                formatted_number(found[condition]["ap_r40"], 3) if condition in found else NOTHING
                for condition in ("clean", "adv", RANDOM_BEST)
            ),
        )


def _defence_lines(cell: Cell) -> Iterator[tuple[str, ...]]:
    for place, each in enumerate(cell.listed.get("defences", ())):
        yield (
            _once(cell, place),
            each["defence"],
            formatted_number(each["clean_map_kept_percent"], 1),
            formatted_number(each["map_ratio_percent"], 2),
            _interval(each, "map_ratio_ci95"),
            formatted_number(each.get("random_best_map_ratio_percent"), 2),
            formatted_number(each.get("map_ratio_delta_points_vs_random_best"), 2),
            _interval(each, "map_ratio_delta_points_vs_random_best_ci95"),
            ANSWER[each.get("significant_vs_random_best")],
            formatted_number(each.get("map_loose_ratio_percent"), 2),
            formatted_number(each.get("random_best_map_loose_ratio_percent"), 2),
            formatted_number(each.get("map_loose_ratio_delta_points_vs_random_best"), 2),
            _interval(each, "map_loose_ratio_delta_points_vs_random_best_ci95"),
            formatted_number(each["frames"], 0),
        )


def _check_lines(cell: Cell) -> Iterator[tuple[str, ...]]:
    for place, each in enumerate(cell.listed.get("attack_detection", ())):
        yield (
            _once(cell, place),
            each["check"],
            formatted_number(each["true_positive_percent"], 1),
            formatted_number(each["false_positive_percent"], 1),
            formatted_number(each["auc"], 3),
            formatted_number(each["points_true_positive_percent"], 1),
            formatted_number(each["points_false_positive_percent"], 2),
        )


def _once(cell: Cell, place: int) -> str:
    """The name of a cell, before its first line alone."""
    return "" if place else cell.name


def _interval(record: Record, key: str) -> str:
    bounds = record.get(key)
    return interval(tuple(bounds)) if bounds else NOTHING
