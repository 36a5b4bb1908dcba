"""Figures of one kind of cloud: the clean, the adversarial, or those of a random baseline."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

Interval = tuple[float, float] | None
"""A 95 % interval, low and high; None where there are too few blocks for one."""

Record = dict[str, object]
"""A result as `report.json` and tables have it: one key a figure."""

CRITERIA = ("strict", "loose", "bev", "bev_loose")
"""How a detection has to overlap an object to find it: in 3D or in the bird's eye, strictly or loosely."""


@dataclass(frozen=True)
class Precisions:
    """Average precision (R40) by criterion and class, and the interval of the strict ones by class."""

    ap: Mapping[tuple[str, str], float]
    strict_ci95: Mapping[str, Interval]

    def record(self, word: str) -> Record:
        """Keys such as `ap_car_adv`, strict and with its interval, and `ap_loose_car_adv`."""
        row: Record = {}
        for (criterion, name), value in self.ap.items():
            key = precision_key(criterion, name, word)
            row[key] = value
            if criterion == "strict":
                row[f"{key}_ci95"] = self.strict_ci95[name]
        return row


def precision_key(criterion: str, class_name: str, word: str) -> str:
    """Where a record has an average precision; word: `clean` or `adv`."""
    return f"ap_{class_name}_{word}" if criterion == "strict" else f"ap_{criterion}_{class_name}_{word}"


@dataclass(frozen=True)
class CleanMeans:
    """mAP on the clean clouds by one criterion: R40 with its interval, and R11."""

    map_r40: float
    map_r40_ci95: Interval
    map_r11: float


@dataclass(frozen=True)
class CleanFigures:
    """What the detector made of the clean clouds; means: by criterion."""

    means: Mapping[str, CleanMeans]
    precisions: Precisions

    def record(self) -> Record:
        """Keys such as `map_clean`, of the strict criterion, and `map_loose_clean`."""
        row: Record = {}
        for criterion, mean in self.means.items():
            word = "" if criterion == "strict" else f"{criterion}_"
            row |= {f"map_{word}clean": mean.map_r40, f"map_{word}clean_ci95": mean.map_r40_ci95}
            row[f"map_{word}r11_clean"] = mean.map_r11
        return row | self.precisions.record("clean")


@dataclass(frozen=True)
class CloudFigures:
    """What changed clouds lead to: an attack's, or those of a random baseline of equal budget.

    The ratios are of the clean clouds of the same frames, in percent. Displacements are over all moved
    points of all frames.
    """

    map_adv: float
    map_adv_ci95: Interval
    map_ratio_percent: float
    map_ratio_ci95: Interval
    map_loose_adv: float
    map_loose_ratio_percent: float
    map_bev_adv: float
    map_bev_loose_adv: float
    chamfer_distance_m2: float
    attack_success_percent: float
    mean_displacement_m: float
    rms_displacement_m: float
    median_displacement_m: float
    p95_displacement_m: float
    max_displacement_m: float
    max_added_m: float
    points_added: int
    points_removed: int
    points_moved: int
    objects_below_min_points: int
    found_objects: int
    false_positives: int
    lost_objects: int
    new_false_positives: int
    precisions: Precisions

    def record(self) -> Record:
        """One key a figure, and one an average precision."""
        return {name: getattr(self, name) for name in figure_names(CloudFigures)} | self.precisions.record(
            "adv"
        )


@dataclass(frozen=True)
class RecountedFigures:
    """What would be if the objects were counted on the attacked clouds: not what counts elsewhere."""

    objects_recounted: int
    map_adv_recounted: float
    map_ratio_percent_recounted: float
    map_ratio_recounted_ci95: Interval
    lost_objects_recounted: int
    attack_success_percent_recounted: float


@dataclass(frozen=True)
class BaselineFigures:
    """A random baseline, and how many points of mAP ratio the attack costs beyond it, drawn together.

    is_significant: whether the interval of that difference lies below 0; None where there is no interval.
    """

    figures: CloudFigures
    map_ratio_delta_points: float
    map_ratio_delta_points_ci95: Interval
    is_significant: bool | None


def figure_names(figures: type) -> list[str]:
    """The fields that are figures: all but the average precisions."""
    return [field.name for field in fields(figures) if field.name != "precisions"]


def nothing(figures: type, precisions: Iterable[tuple[str, str]] = ()) -> Record:
    """The record of figures where there are none: the same keys, of these criteria and classes, with None."""
    keys = figure_names(figures)
    for criterion, name in precisions:
        key = precision_key(criterion, name, "adv")
        keys += [key, f"{key}_ci95"] if criterion == "strict" else [key]
    return dict.fromkeys(keys)
