"""What a cell holds beside its row: records that the report of `advpipe evaluate` lists, by the same keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.listed import Listed
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.report import precision_records

ListedRecords = Sequence[Mapping[str, Any]]

CONDITIONS = ("clean", "adv", RANDOM_BEST)
"""Those whose records are kept."""

_OF_THE_CELL = ("bag", "detector", "attack", "recipe", "parameter", "value")


def listed_results(summary: Summary) -> dict[str, ListedRecords]:
    """Of the attack and the baseline to beat: `attack_success` of all objects and by range, and the strict
    `average_precision` of the classes of the mAP by range; `defences` and `attack_detection`, empty where
    they were not asked for."""
    in_map = summary.result.counts.classes_in_map
    return {
        "attack_success": _plain(
            each
            for each in summary.success
            if each.condition in CONDITIONS and each.class_name == EVERY_CLASS
        ),
        "average_precision": _plain(
            each
            for each in precision_records([summary])
            if each.condition in CONDITIONS
            and (each.criterion, each.by) == ("strict", "range")
            and each.class_name in in_map
        ),
        "defences": _plain(summary.defended),
        "attack_detection": _plain(summary.attack_detection),
    }


def _plain(records: Iterable[Listed]) -> ListedRecords:
    """As JSON has them, without what the whole cell has in common."""
    return [
        {key: plain_value(value) for key, value in each.record().items() if key not in _OF_THE_CELL}
        for each in records
    ]
