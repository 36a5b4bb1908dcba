"""One row of a report: an adversarial bag, or the clean one alone, as one detector sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from advpipe.pipeline.results.figures import (
    BaselineFigures,
    CleanFigures,
    CloudFigures,
    Record,
    RecountedFigures,
    nothing,
)

PLAIN_BASELINE = "baseline"
"""The word of the baseline whose keys every row has, None where it was not scored."""


@dataclass(frozen=True)
class AttackRecord:
    """The attack that made a bag, by the bag's own record.

    parameter, value: its budget. attacked_against: the detector. is_white_box: whether that is the one that
    looks; None where nobody can say. query_budget: how many
    detector queries the attack used to keep the best try. baseline_tries: of
    how many the best is among the baselines.
    """

    attack: str
    recipe: str | None
    parameter: str | None
    value: Any
    parameters: Mapping[str, Any]
    attacked_against: str | None
    is_white_box: bool | None
    query_budget: int | None
    baseline_tries: int


@dataclass(frozen=True)
class FrameCounts:
    """What was scored. working_score: the score of the best F1 on the clean clouds, from which objects and
    detections are counted. objects: evaluated ones."""

    frames: int
    blocks: int
    classes_in_map: tuple[str, ...]
    working_score: float
    objects: int
    objects_found_clean: int
    false_positives_clean: int
    points_clean: int


@dataclass(frozen=True)
class ResultRow:
    """The figures of one bag and detector.

    boxes: evaluated ones by class. attacked, recounted: None without an attack. baselines: by word, those
    that were scored. significant_vs_random: whether the attack is
    significantly stronger than all of them; None where that is unknown. notes: what the
    reader must know besides.
    """

    bag: str
    detector: str
    attack: AttackRecord
    counts: FrameCounts
    boxes: Mapping[str, int]
    clean: CleanFigures
    attacked: CloudFigures | None
    recounted: RecountedFigures | None
    baselines: Mapping[str, BaselineFigures]
    significant_vs_random: bool | None
    notes: tuple[str, ...]

    def figures_of(self, baseline: str = "") -> CloudFigures | None:
        """Those of the attack, None without one; or those of a baseline that was scored, by its word."""
        return self.baselines[baseline].figures if baseline else self.attacked

    @property
    def strongest_baseline(self) -> str | None:
        """The word of the plain random baseline with the lowest mAP ratio; None where none is defined."""
        return lowest({word: each.figures.map_ratio_percent for word, each in self.baselines.items()})

    def record(self) -> Record:
        """The row as `report.json` has it: flat, a baseline's word before each of its figures."""
        known = self.clean.precisions.ap
        row: Record = {"bag": self.bag, "detector": self.detector, **asdict(self.attack)}
        row |= asdict(self.counts) | {"classes_in_map": list(self.counts.classes_in_map)}
        row |= {f"boxes_{name}": count for name, count in self.boxes.items()}
        row |= self.clean.record()
        row |= self.attacked.record() if self.attacked else nothing(CloudFigures, known)
        row |= asdict(self.recounted) if self.recounted else nothing(RecountedFigures)
        row |= {f"{PLAIN_BASELINE}_{key}": None for key in nothing(CloudFigures, known)}
        row |= {f"map_ratio_delta_points_vs_{PLAIN_BASELINE}{end}": None for end in ("", "_ci95")}
        for word, baseline in self.baselines.items():
            row |= {f"{word}_{key}": value for key, value in baseline.figures.record().items()}
            row[f"map_ratio_delta_points_vs_{word}"] = baseline.map_ratio_delta_points
            row[f"map_ratio_delta_points_vs_{word}_ci95"] = baseline.map_ratio_delta_points_ci95
            row[f"significant_vs_{word}"] = baseline.is_significant
        return row | {
            "baselines": list(self.baselines),
            "significant_vs_random": self.significant_vs_random,
            "notes": list(self.notes),
        }


def lowest(ratios: Mapping[str, float]) -> str | None:
    """The word with the lowest ratio, of those that are defined; None without one."""
    defined = {word: ratio for word, ratio in ratios.items() if ratio == ratio}
    return min(defined, key=lambda word: defined[word]) if defined else None
