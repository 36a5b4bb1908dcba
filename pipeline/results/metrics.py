"""Metrics of one condition: the clean clouds, the adversarial ones, or those of a random baseline."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated

Interval = tuple[float, float] | None
"""A 95 % interval, low and high; None where there are too few blocks for one."""

Record = dict[str, object]
"""A result as `report.json` and tables have it: one key per metric."""

CRITERIA = ("strict", "loose", "bev", "bev_loose")
"""How a detection has to overlap an object to find it: in 3D or in the bird's eye, strictly or loosely."""


MIN_CLEAN_MAP = 0.05
"""A ratio to a lower clean mAP says nothing: a few detections more or less change it manyfold."""


def ratio_reason(map_clean: float, ci95: Interval) -> str:
    """Why a ratio to a clean mAP with this interval is not meaningful; "" where it is."""
    if map_clean == 0:
        return "nothing found on the clean bag"
    if map_clean < MIN_CLEAN_MAP:
        return f"the clean mAP, {map_clean:.3f}, is below {MIN_CLEAN_MAP}"
    if ci95 is not None and ci95[0] <= 0:
        return f"the 95 % interval of the clean mAP, {ci95[0]:.3f} to {ci95[1]:.3f}, includes 0"
    return ""


@dataclass(frozen=True)
class Precisions:
    """Average precision (R40) by criterion and class, and the interval of the strict ones by class."""

    ap: Mapping[tuple[str, str], float]
    strict_ci95: Mapping[str, Interval]

    def record(self, condition: str) -> Record:
        """Keys such as `ap_car_adv`, strict and with its interval, and `ap_loose_car_adv`."""
        row: Record = {}
        for (criterion, name), value in self.ap.items():
            key = precision_key(criterion, name, condition)
            row[key] = value
            if criterion == "strict":
                row[f"{key}_ci95"] = self.strict_ci95[name]
        return row


def precision_key(criterion: str, class_name: str, condition: str) -> str:
    """The key of an average precision in a record; condition: `clean` or `adv`."""
    return (
        f"ap_{class_name}_{condition}"
        if criterion == "strict"
        else f"ap_{criterion}_{class_name}_{condition}"
    )


@dataclass(frozen=True)
class CleanMeans:
    """mAP on the clean clouds by one criterion: R40 with its interval, and R11."""

    map_r40: float
    map_r40_ci95: Interval
    map_r11: float


@dataclass(frozen=True)
class CleanMetrics:
    """The detector's results on the clean clouds; means: by criterion."""

    means: Mapping[str, CleanMeans]
    precisions: Precisions

    def record(self) -> Record:
        """Keys such as `map_clean`, of the strict criterion, and `map_loose_clean`."""
        row: Record = {}
        for criterion, mean in self.means.items():
            prefix = "" if criterion == "strict" else f"{criterion}_"
            row |= {f"map_{prefix}clean": mean.map_r40, f"map_{prefix}clean_ci95": mean.map_r40_ci95}
            row[f"map_{prefix}r11_clean"] = mean.map_r11
        return row | self.precisions.record("clean")


@dataclass(frozen=True)
class CloudMetrics:
    """The detector's results on changed clouds: an attack's, or those of a random baseline of equal budget.

    The ratios are of the clean clouds of the same frames, in percent. Displacements are over all moved
    points of all frames.
    """

    map_adv: Annotated[float, "strict 3D mAP (R40), in [0, 1]"]
    map_adv_ci95: Annotated[Interval, "its 95 % interval"]
    map_ratio_percent: Annotated[
        float,
        "strict mAP in percent of that on the clean clouds of the same frames; null where it is not "
        "meaningful, see map_ratio_reason",
    ]
    map_ratio_ci95: Annotated[Interval, "95 % interval of map_ratio_percent, in percent"]
    map_loose_adv: Annotated[float, "loose 3D mAP (R40), in [0, 1]"]
    map_loose_ratio_percent: Annotated[float, "loose mAP in percent of that on the clean clouds"]
    map_bev_adv: Annotated[float, "strict mAP in the bird's-eye view (R40), in [0, 1]"]
    map_bev_loose_adv: Annotated[float, "loose mAP in the bird's-eye view (R40), in [0, 1]"]
    chamfer_distance_m2: Annotated[
        float, "Chamfer distance to the clean clouds, mean over frames, in square metres"
    ]
    attack_success_percent: Annotated[
        float, "lost objects in percent of the objects found on the clean clouds, at loose overlap"
    ]
    mean_displacement_m: Annotated[float, "mean displacement of moved points, in metres"]
    rms_displacement_m: Annotated[float, "root mean square of the displacement of moved points, in metres"]
    median_displacement_m: Annotated[float, "median displacement of moved points, in metres"]
    p95_displacement_m: Annotated[float, "95th percentile of the displacement of moved points, in metres"]
    max_displacement_m: Annotated[float, "largest displacement of a moved point, in metres"]
    max_added_m: Annotated[
        float, "largest distance from an added point to the nearest clean point, in metres"
    ]
    points_added: Annotated[int, "number of points added, all frames"]
    points_removed: Annotated[int, "number of points removed, all frames"]
    points_moved: Annotated[int, "number of points moved, all frames"]
    objects_below_min_points: Annotated[int, "number of evaluated objects with fewer than 5 points left"]
    found_objects: Annotated[int, "number of objects found, at loose overlap and the working score"]
    false_positives: Annotated[int, "number of false positives, at loose overlap and the working score"]
    lost_objects: Annotated[
        int, "number of objects found on the clean clouds and missed here, at loose overlap"
    ]
    new_false_positives: Annotated[int, "number of false positives where the clean clouds have none"]
    precisions: Precisions
    map_loose_ratio_ci95: Annotated[
        Interval, "95 % interval of map_loose_ratio_percent, in percent; absent in older reports"
    ] = None
    points_off_ray: Annotated[
        int | None, "number of moved points that left their ray by over 1 mm; absent in older reports"
    ] = None
    at_face_percent: Annotated[
        float,
        "moved and added points within 1.5 mm of a face of their voxel, in percent; null for a detector "
        "without voxels; absent in older reports",
    ] = math.nan
    at_face_clean_percent: Annotated[
        float, "at_face_percent of all points of the clean clouds, in percent; absent in older reports"
    ] = math.nan

    def record(self) -> Record:
        """One key per metric and per average precision."""
        return {name: getattr(self, name) for name in metric_names(CloudMetrics)} | self.precisions.record(
            "adv"
        )


@dataclass(frozen=True)
class RecountedMetrics:
    """The results if the objects were counted on the attacked clouds, unlike in all other metrics."""

    objects_recounted: Annotated[int, "number of objects with at least 5 points in the attacked clouds"]
    map_adv_recounted: Annotated[float, "strict mAP over the recounted objects, in [0, 1]"]
    map_ratio_percent_recounted: Annotated[float, "map_adv_recounted in percent of the clean mAP"]
    map_ratio_recounted_ci95: Annotated[Interval, "95 % interval of map_ratio_percent_recounted, in percent"]
    lost_objects_recounted: Annotated[
        int, "number of recounted objects found on the clean clouds and missed here"
    ]
    attack_success_percent_recounted: Annotated[
        float, "lost recounted objects in percent of the objects found on the clean clouds"
    ]


@dataclass(frozen=True)
class BaselineMetrics:
    """A random baseline, and how many points of mAP ratio the attack costs beyond it, drawn together.

    is_significant: whether the interval of that difference lies below 0; None where there is no interval.
    Both are of strict overlap; map_loose_...: the same difference at loose overlap, NaN in older reports.
    """

    metrics: CloudMetrics
    map_ratio_delta_points: float
    map_ratio_delta_points_ci95: Interval
    is_significant: bool | None
    map_loose_ratio_delta_points: float = math.nan
    map_loose_ratio_delta_points_ci95: Interval = None


def metric_names(record: type) -> list[str]:
    """The fields that are single metrics: all but the average precisions."""
    return [field.name for field in fields(record) if field.name != "precisions"]


def undefined_record(record: type, precisions: Iterable[tuple[str, str]] = ()) -> Record:
    """The record of undefined metrics: the same keys, of these criteria and classes, with None."""
    keys = metric_names(record)
    for criterion, name in precisions:
        key = precision_key(criterion, name, "adv")
        keys += [key, f"{key}_ci95"] if criterion == "strict" else [key]
    return dict.fromkeys(keys)
