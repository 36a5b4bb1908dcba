"""Records that `report.json` lists beside its rows, one a line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from advpipe.pipeline.results.figures import Interval, Precisions, Record
from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class PrecisionRecord(Listed):
    """One average precision of a class by a criterion, in a stratum of those cut `by` a measure; of all
    objects, `by` is empty and the stratum is `all`. boxes: how many objects were to be found."""

    bag: str
    detector: str
    condition: str
    class_name: str
    criterion: str
    by: str
    stratum: str
    boxes: int
    ap_r40: float
    ap_r40_ci95: Interval
    ap_r11: float


@dataclass(frozen=True)
class _OfAttack(Listed):
    bag: str
    detector: str
    attack: str
    recipe: str | None
    parameter: str | None
    value: Any


@dataclass(frozen=True)
class SuccessRecord(_OfAttack):
    """Objects found on the clean clouds and lost on those under `condition`, of a class and a range; at loose
    overlap, those named `strict_` at strict overlap, with a score of at least `min_score`."""

    condition: str
    class_name: str
    range: str
    min_score: float
    found_clean: int
    lost: int
    attack_success_percent: float
    attack_success_ci95: Interval
    strict_found_clean: int
    strict_lost: int
    strict_attack_success_percent: float
    strict_attack_success_ci95: Interval
    new_false_positives: int


@dataclass(frozen=True)
class DefendedFigures:
    """What an attack leads to under a defence. map_ratio_percent: of the clean clouds under the defence;
    map_adv_percent: of those without."""

    map_adv: float
    map_adv_ci95: Interval
    map_ratio_percent: float
    map_ratio_ci95: Interval
    map_adv_percent: float
    map_adv_percent_ci95: Interval
    precisions: Precisions


@dataclass(frozen=True)
class DefenceRecord(_OfAttack):
    """A defence: the mAP that it leaves on clean clouds, in percent of that without it, and the attack's
    effect under it; None without an attack."""

    defence: str
    frames: int
    map_clean: float
    map_clean_ci95: Interval
    clean_map_kept_percent: float
    clean_map_kept_ci95: Interval
    clean_precisions: Precisions
    attacked: DefendedFigures | None

    def record(self) -> Record:
        """The record as `report.json` has it."""
        row: Record = {name: value for name, value in vars(self).items() if name not in _NESTED}
        row |= self.clean_precisions.record("clean")
        if self.attacked is None:
            return row
        row |= {name: value for name, value in vars(self.attacked).items() if name != "precisions"}
        return row | self.attacked.precisions.record("adv")


_NESTED = ("clean_precisions", "attacked")


@dataclass(frozen=True)
class BaselineRecord(_OfAttack):
    """A random baseline beside an attack; delta_points: the attack's mAP ratio minus the
    baseline's, in percentage points."""

    baseline: str
    map_ratio_percent: float
    map_ratio_ci95: Interval
    delta_points: float
    delta_points_ci95: Interval
    significant: bool | None


@dataclass(frozen=True)
class TransferRecord(Listed):
    """An attack made against one detector, as another sees it."""

    bag: str
    attack: str
    recipe: str | None
    parameter: str | None
    value: Any
    parameters: Mapping[str, Any]
    attacked_against: str
    frames: int
    evaluated_with: str
    is_white_box: bool | None
    map_clean: float
    map_ratio_percent: float | None
    map_ratio_ci95: Interval
