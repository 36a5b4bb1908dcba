"""One row of a report: an adversarial bag, or the clean one alone, as one detector sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from advpipe.pipeline.results.metrics import (
    BaselineMetrics,
    CleanMetrics,
    CloudMetrics,
    Record,
    RecountedMetrics,
    ratio_reason,
    undefined_record,
)

PLAIN_BASELINE = "baseline"
"""The name of the baseline whose keys every row has, None where it was not scored."""

RANDOM_BEST = "random_best"
"""The name of the baseline to beat: recipe `random-best`, with as many judged tries as the attack."""


@dataclass(frozen=True)
class AttackRecord:
    """The attack that made a bag, by the bag's own record.

    parameter, value: its budget. attacked_against: the detector. is_white_box: whether that is the
    evaluated one; None where that is unknown. query_budget: how many
    detector queries the attack used to keep the best try. baseline_tries: of
    how many `random_best` is the best.
    """

    attack: Annotated[str, "name of the attack"]
    recipe: Annotated[str | None, "recipe of a LiDAR attack; null for other attacks"]
    parameter: Annotated[str | None, "name of the parameter that is the attack's budget"]
    value: Annotated[Any, "the budget's value, in the unit of the parameter"]
    parameters: Annotated[Mapping[str, Any], "all parameters of the attack by name"]
    attacked_against: Annotated[str | None, "detector that the attack was made against"]
    is_white_box: Annotated[bool | None, "whether that is the evaluated detector; null where that is unknown"]
    query_budget: Annotated[int | None, "number of detector queries of which the attack keeps the best"]
    baseline_tries: Annotated[
        int, "number of random tries of which baseline random_best is the best; 0 without baselines"
    ]


@dataclass(frozen=True)
class FrameCounts:
    """What was scored. working_score: the score of the best F1 on the clean clouds, from which objects and
    detections are counted. objects: evaluated ones."""

    frames: Annotated[int, "number of frames scored"]
    blocks: Annotated[int, "number of blocks of at least 5 s that the bootstrap draws from"]
    classes_in_map: Annotated[tuple[str, ...], "classes that the mAP is the mean of"]
    working_score: Annotated[
        float, "score of the best F1 on the clean clouds, from which detections and objects are counted"
    ]
    objects: Annotated[int, "number of evaluated objects, all frames"]
    objects_found_clean: Annotated[int, "number of objects found on the clean clouds, at loose overlap"]
    false_positives_clean: Annotated[int, "number of false positives on the clean clouds, at loose overlap"]
    points_clean: Annotated[int, "number of points in the clean clouds, all frames"]


@dataclass(frozen=True)
class ResultRow:
    """The metrics of one bag and detector.

    boxes: evaluated ones by class. attacked, recounted: None without an attack. baselines: by name, those
    that were scored. significant_vs_random: whether the attack is significantly stronger than the strongest
    of them; None where that is unknown. notes: what the reader must know besides.
    """

    bag: str
    detector: str
    attack: AttackRecord
    counts: FrameCounts
    boxes: Mapping[str, int]
    clean: CleanMetrics
    attacked: CloudMetrics | None
    recounted: RecountedMetrics | None
    baselines: Mapping[str, BaselineMetrics]
    significant_vs_random: bool | None
    notes: tuple[str, ...]

    def metrics_of(self, baseline: str = "") -> CloudMetrics | None:
        """Those of the attack, None without one; or those of a baseline that was scored, by name."""
        return self.baselines[baseline].metrics if baseline else self.attacked

    @property
    def map_ratio_reason(self) -> str:
        """Why the strict mAP ratios are not meaningful; "" where they are."""
        strict = self.clean.means["strict"]
        return ratio_reason(strict.map_r40, strict.map_r40_ci95)

    @property
    def strongest_baseline(self) -> str | None:
        """The name of the baseline to beat: `random_best` where it was scored, else the one with the lowest
        mAP ratio; None where none is defined."""
        if RANDOM_BEST in self.baselines:
            return RANDOM_BEST
        return lowest({name: each.metrics.map_ratio_percent for name, each in self.baselines.items()})

    @property
    def identity(self) -> tuple[str, str, str, str | None, str | None, Any]:
        """What a record of this attack begins with: bag, detector, attack, recipe, parameter and value."""
        attack = self.attack
        return self.bag, self.detector, attack.attack, attack.recipe, attack.parameter, attack.value

    def record(self) -> Record:
        """The row as `report.json` has it: flat, each key of a baseline begins with its name."""
        known = self.clean.precisions.ap
        row: Record = {"bag": self.bag, "detector": self.detector, **asdict(self.attack)}
        row |= asdict(self.counts) | {"classes_in_map": list(self.counts.classes_in_map)}
        row |= {f"boxes_{name}": count for name, count in self.boxes.items()}
        row |= self.clean.record()
        if reason := self.map_ratio_reason:
            row["map_ratio_reason"] = reason
        row |= self.attacked.record() if self.attacked else undefined_record(CloudMetrics, known)
        row |= asdict(self.recounted) if self.recounted else undefined_record(RecountedMetrics)
        row |= {f"{PLAIN_BASELINE}_{key}": None for key in undefined_record(CloudMetrics, known)}
        row |= {
            f"map_{kind}ratio_delta_points_vs_{PLAIN_BASELINE}{end}": None
            for kind in ("", "loose_")
            for end in ("", "_ci95")
        }
        for name, baseline in self.baselines.items():
            row |= {f"{name}_{key}": value for key, value in baseline.metrics.record().items()}
            row[f"map_ratio_delta_points_vs_{name}"] = baseline.map_ratio_delta_points
            row[f"map_ratio_delta_points_vs_{name}_ci95"] = baseline.map_ratio_delta_points_ci95
            row[f"map_loose_ratio_delta_points_vs_{name}"] = baseline.map_loose_ratio_delta_points
            row[f"map_loose_ratio_delta_points_vs_{name}_ci95"] = baseline.map_loose_ratio_delta_points_ci95
            row[f"significant_vs_{name}"] = baseline.is_significant
        return row | {
            "baselines": list(self.baselines),
            "significant_vs_random": self.significant_vs_random,
            "notes": list(self.notes),
        }


def lowest(ratios: Mapping[str, float]) -> str | None:
    """The name with the lowest ratio, of those that are defined; None without one."""
    defined = {name: ratio for name, ratio in ratios.items() if ratio == ratio}
    return min(defined, key=lambda name: defined[name]) if defined else None
