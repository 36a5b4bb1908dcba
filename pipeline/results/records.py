"""Records that `report.json` lists beside its rows, one a line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from advpipe.pipeline.results.listed import Listed
from advpipe.pipeline.results.metrics import Interval, Precisions, Record


@dataclass(frozen=True)
class PrecisionRecord(Listed):
    """One average precision of a class by a criterion, in a stratum of those cut `by` a measure; of all
    objects, `by` is empty and the stratum is `all`. boxes: how many objects were to be found."""

    bag: Annotated[str, "adversarial bag, or `clean`"]
    detector: Annotated[str, "evaluated detector"]
    condition: Annotated[str, "`clean`, `adv` or the name of a baseline"]
    class_name: Annotated[str, "object class"]
    criterion: Annotated[str, "overlap criterion: strict, loose, bev or bev_loose"]
    by: Annotated[str, "measure that the stratum is of: range, points or occlusion; empty for all objects"]
    stratum: Annotated[str, "stratum of objects; `all` without one"]
    boxes: Annotated[int, "number of objects to find"]
    ap_r40: Annotated[float, "average precision at 40 recall positions, in [0, 1]"]
    ap_r40_ci95: Annotated[Interval, "95 % interval of ap_r40"]
    ap_r11: Annotated[float, "average precision at 11 recall positions, in [0, 1]"]


@dataclass(frozen=True)
class _OfAttack(Listed):
    bag: Annotated[str, "adversarial bag"]
    detector: Annotated[str, "evaluated detector"]
    attack: Annotated[str, "name of the attack"]
    recipe: Annotated[str | None, "recipe of a LiDAR attack; null for other attacks"]
    parameter: Annotated[str | None, "name of the parameter that is the attack's budget"]
    value: Annotated[Any, "the budget's value, in the unit of the parameter"]


@dataclass(frozen=True)
class SuccessRecord(_OfAttack):
    """Objects found on the clean clouds and lost on those under `condition`, of a class and a range; at loose
    overlap, those named `strict_` at strict overlap, with a score of at least `min_score`."""

    condition: Annotated[str, "`adv` or the name of a baseline"]
    class_name: Annotated[str, "object class; `all` for every class"]
    range: Annotated[str, "range of distances from the sensor, in metres; `all` for every distance"]
    min_score: Annotated[float, "lowest score of detections that count"]
    found_clean: Annotated[int, "number of objects found on the clean clouds, at loose overlap"]
    lost: Annotated[int, "number of these that are missed here, at loose overlap"]
    attack_success_percent: Annotated[float, "lost in percent of found_clean"]
    attack_success_ci95: Annotated[Interval, "95 % interval of attack_success_percent, in percent"]
    strict_found_clean: Annotated[int, "number of objects found on the clean clouds, at strict overlap"]
    strict_lost: Annotated[int, "number of these that are missed here, at strict overlap"]
    strict_attack_success_percent: Annotated[float, "strict_lost in percent of strict_found_clean"]
    strict_attack_success_ci95: Annotated[
        Interval, "95 % interval of strict_attack_success_percent, in percent"
    ]
    displaced: Annotated[
        int, "number of objects found at strict overlap on the clean clouds and here at loose overlap only"
    ]
    new_false_positives: Annotated[int, "number of false positives where the clean clouds have none"]


@dataclass(frozen=True)
class EffectRecord(_OfAttack):
    """What one condition leaves of the detector's results, over all frames or over the attacked ones alone:
    the mAP ratio at strict and at loose overlap, and objects lost and displaced. An object is lost if it is
    found on the clean cloud and missed here, at loose overlap; displaced if it is found on the clean cloud at
    strict overlap and here at loose overlap only."""

    condition: Annotated[str, "`adv` or the name of a baseline"]
    frames: Annotated[str, "`all`, or `attacked`: those in which the attack changed points of the cloud"]
    frame_count: Annotated[int, "number of these frames"]
    blocks: Annotated[int, "number of blocks of at least 5 s that the bootstrap draws from"]
    map_ratio_percent: Annotated[
        float, "strict mAP in percent of that on the clean clouds of the same frames; null where that is 0"
    ]
    map_ratio_ci95: Annotated[Interval, "95 % interval of map_ratio_percent, in percent"]
    map_loose_ratio_percent: Annotated[float, "loose mAP in percent of that on the clean clouds"]
    map_loose_ratio_ci95: Annotated[Interval, "95 % interval of map_loose_ratio_percent, in percent"]
    found_clean: Annotated[int, "number of objects found on the clean clouds, at loose overlap"]
    lost_objects: Annotated[int, "number of these that are missed here, at loose overlap"]
    lost_percent: Annotated[float, "lost_objects in percent of found_clean"]
    lost_ci95: Annotated[Interval, "95 % interval of lost_percent, in percent"]
    strict_found_clean: Annotated[int, "number of objects found on the clean clouds, at strict overlap"]
    displaced_objects: Annotated[int, "number of these that are found here at loose overlap only"]
    displaced_percent: Annotated[float, "displaced_objects in percent of strict_found_clean"]
    displaced_ci95: Annotated[Interval, "95 % interval of displaced_percent, in percent"]


@dataclass(frozen=True)
class AttackDetectionRecord(_OfAttack):
    """How well a check tells the attacked clouds from clean ones. Its threshold is calibrated on clean clouds
    of the drive: those of the second half of the frames for the first half, and the other way round."""

    check: Annotated[str, "name of the check"]
    frames: Annotated[int, "number of clean clouds that were judged"]
    attacked_frames: Annotated[int, "number of clouds in which the attack changed points"]
    calibration_frames: Annotated[int, "number of clean clouds that a threshold is calibrated on, at least"]
    expected_false_positive_percent: Annotated[
        float, "share of further clean clouds that exceed such a threshold at most, in percent"
    ]
    true_positive_percent: Annotated[float, "attacked clouds above the threshold, in percent"]
    false_positive_percent: Annotated[float, "clean clouds above the threshold, in percent"]
    auc: Annotated[float, "area under the ROC curve over clean and attacked clouds, in [0, 1]"]
    points_true_positive_percent: Annotated[
        float, "points that the attack moved or added and the check flags, in percent; null if it flags none"
    ]
    points_false_positive_percent: Annotated[float, "points of the clean clouds that it flags, in percent"]
    new_detections: Annotated[int, "number of detections in attacked clouds that the clean ones lack"]
    new_detections_true_positive_percent: Annotated[
        float, "these above the threshold, in percent; null for a check that judges no detections"
    ]
    detections_false_positive_percent: Annotated[
        float, "detections in the clean clouds above the threshold, in percent"
    ]
    new_detections_called_fake_percent: Annotated[
        float,
        "detections in attacked clouds that the clean ones lack and a published detector takes for spoofed, "
        "by limits of its own, in percent; null for other checks",
    ]
    detections_called_fake_percent: Annotated[
        float, "detections in the clean clouds that it takes for spoofed, in percent"
    ]


@dataclass(frozen=True)
class DefendedMetrics:
    """What an attack leads to under a defence. map_ratio_percent: of the clean clouds under the defence;
    map_adv_percent: of those without."""

    map_adv: Annotated[float, "strict mAP on attacked clouds under the defence, in [0, 1]"]
    map_adv_ci95: Annotated[Interval, "its 95 % interval"]
    map_ratio_percent: Annotated[float, "map_adv in percent of the mAP on clean clouds under the defence"]
    map_ratio_ci95: Annotated[Interval, "95 % interval of map_ratio_percent, in percent"]
    map_adv_percent: Annotated[float, "map_adv in percent of the mAP on clean clouds without the defence"]
    map_adv_percent_ci95: Annotated[Interval, "95 % interval of map_adv_percent, in percent"]
    map_loose_ratio_percent: Annotated[
        float, "loose mAP on attacked clouds in percent of that on clean clouds, both under the defence"
    ]
    map_loose_ratio_ci95: Annotated[Interval, "95 % interval of map_loose_ratio_percent, in percent"]
    precisions: Precisions


@dataclass(frozen=True)
class DefendedBaseline:
    """The baseline to beat under a defence, and the attack beside it."""

    random_best_map_adv: Annotated[float, "strict mAP of random_best under the defence, in [0, 1]"]
    random_best_map_ratio_percent: Annotated[
        float, "random_best_map_adv in percent of the mAP on clean clouds under the defence"
    ]
    random_best_map_ratio_ci95: Annotated[
        Interval, "95 % interval of random_best_map_ratio_percent, in percent"
    ]
    map_ratio_delta_points_vs_random_best: Annotated[
        float, "map_ratio_percent minus random_best_map_ratio_percent, in percentage points"
    ]
    map_ratio_delta_points_vs_random_best_ci95: Annotated[
        Interval, "95 % interval of that difference, drawn together, in percentage points"
    ]
    significant_vs_random_best: Annotated[
        bool | None, "whether that interval lies below 0; null with fewer than six blocks, or without one"
    ]
    random_best_map_loose_ratio_percent: Annotated[
        float, "loose mAP of random_best in percent of that on clean clouds, both under the defence"
    ]
    random_best_map_loose_ratio_ci95: Annotated[
        Interval, "95 % interval of random_best_map_loose_ratio_percent, in percent"
    ]
    map_loose_ratio_delta_points_vs_random_best: Annotated[
        float, "map_loose_ratio_percent minus random_best_map_loose_ratio_percent, in percentage points"
    ]
    map_loose_ratio_delta_points_vs_random_best_ci95: Annotated[
        Interval, "95 % interval of that difference, drawn together, in percentage points"
    ]


@dataclass(frozen=True)
class DefenceRecord(_OfAttack):
    """A defence: the mAP that it leaves on clean clouds, in percent of that without it, and the effects of
    the attack and of random_best under it, absent where they were not scored; all of the same frames."""

    defence: Annotated[str, "the defence with its parameters; `none` for the same frames without one"]
    frames: Annotated[int, "number of frames that defences were scored on, evenly spread"]
    blocks: Annotated[int, "number of blocks of at least 5 s that the bootstrap draws from"]
    map_clean: Annotated[float, "strict mAP on clean clouds under the defence, in [0, 1]"]
    map_clean_ci95: Annotated[Interval, "its 95 % interval"]
    clean_map_kept_percent: Annotated[
        float, "map_clean in percent of the mAP on clean clouds without the defence"
    ]
    clean_map_kept_ci95: Annotated[Interval, "95 % interval of clean_map_kept_percent, in percent"]
    clean_map_loose_kept_percent: Annotated[
        float, "loose mAP on clean clouds under the defence in percent of that without it"
    ]
    clean_precisions: Precisions
    attacked: DefendedMetrics | None
    baseline: DefendedBaseline | None

    def record(self) -> Record:
        """The record as `report.json` has it."""
        row: Record = {name: value for name, value in vars(self).items() if name not in _NESTED}
        row |= self.clean_precisions.record("clean")
        if self.attacked is None:
            return row
        row |= {name: value for name, value in vars(self.attacked).items() if name != "precisions"}
        row |= self.attacked.precisions.record("adv")
        return row | (vars(self.baseline) if self.baseline else {})


_NESTED = ("clean_precisions", "attacked", "baseline")


@dataclass(frozen=True)
class BaselineRecord(_OfAttack):
    """A random baseline beside an attack; delta_points: the attack's mAP ratio minus the
    baseline's, in percentage points."""

    baseline: Annotated[str, "name of the random baseline"]
    map_ratio_percent: Annotated[float, "the baseline's mAP in percent of the clean mAP"]
    map_ratio_ci95: Annotated[Interval, "95 % interval of map_ratio_percent, in percent"]
    delta_points: Annotated[float, "the attack's mAP ratio minus the baseline's, in percentage points"]
    delta_points_ci95: Annotated[
        Interval, "95 % interval of delta_points, drawn together, in percentage points"
    ]
    significant: Annotated[
        bool | None, "whether that interval lies below 0; null with fewer than six blocks, or without one"
    ]
    map_loose_ratio_percent: Annotated[float, "the baseline's loose mAP in percent of the clean one"]
    map_loose_ratio_ci95: Annotated[Interval, "95 % interval of map_loose_ratio_percent, in percent"]
    loose_delta_points: Annotated[
        float, "the attack's loose mAP ratio minus the baseline's, in percentage points"
    ]
    loose_delta_points_ci95: Annotated[
        Interval, "95 % interval of loose_delta_points, drawn together, in percentage points"
    ]


@dataclass(frozen=True)
class TransferRecord(Listed):
    """An attack made against one detector, as another sees it."""

    bag: Annotated[str, "adversarial bag"]
    attack: Annotated[str, "name of the attack"]
    recipe: Annotated[str | None, "recipe of a LiDAR attack; null for other attacks"]
    parameter: Annotated[str | None, "name of the parameter that is the attack's budget"]
    value: Annotated[Any, "the budget's value, in the unit of the parameter"]
    parameters: Annotated[Mapping[str, Any], "all parameters of the attack by name"]
    attacked_against: Annotated[str, "detector that the attack was made against"]
    frames: Annotated[int, "number of frames scored"]
    evaluated_with: Annotated[str, "evaluated detector"]
    is_white_box: Annotated[bool | None, "whether both are the same detector; null where that is unknown"]
    map_clean: Annotated[float, "strict mAP on the clean clouds, in [0, 1]"]
    map_ratio_percent: Annotated[float | None, "mAP on the attacked clouds in percent of map_clean"]
    map_ratio_ci95: Annotated[Interval, "95 % interval of map_ratio_percent, in percent"]
