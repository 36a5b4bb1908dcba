"""The report of an evaluation: its values, what they mean, and what every family of attacks adds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from advpipe.pipeline.results.evaluation import Evaluation
from advpipe.pipeline.results.listed import Listed
from advpipe.pipeline.results.origin import ResultsOrigin
from advpipe.pipeline.results.records import PrecisionRecord
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import formatted_number, undefined_ratio
from advpipe.stages.evaluate.report.section import Formula, ReportSection
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, WHITE_BOX

T = TypeVar("T", bound=Listed)

DEFINITIONS = (
    Formula(
        "ap",
        "AP = (1/40) * sum over r in {1/40, ..., 1} of max precision at recall >= r (R40); R11 reads "
        "precision at r in {0, 0.1, ..., 1} instead",
        ("ap_*_clean", "ap_*_adv", "ap_r40", "ap_r11"),
        title="Average precision (AP)",
    ),
    Formula(
        "map",
        "mAP = mean AP over the classes with at least 50 evaluated boxes in the scored clean frames",
        ("map_clean", "map_adv", "classes_in_map"),
        title="Mean average precision (mAP)",
    ),
    Formula(
        "map_ratio",
        "mAP ratio = 100 % * mAP(adversarial clouds) / mAP(clean clouds), on the same frames",
        ("map_ratio_percent", "map_loose_ratio_percent"),
        title="mAP ratio",
    ),
    Formula(
        "iou",
        "strict 3D IoU: car and truck 0.7, cyclist and pedestrian 0.5; loose: 0.5 and 0.25",
        title="Strict and loose overlap (IoU)",
    ),
    Formula(
        "ignored",
        "no object counts with fewer than 5 points in the clean cloud or with its centre out of the "
        "detector's range in the plane, and no detection that finds one, nor one out of that range",
        title="Objects and detections that do not count",
    ),
    Formula(
        "strata",
        "by range (of the centre, in the plane), by LiDAR points in the clean cloud and by the "
        "recorded occlusion: objects of other strata and their detections are ignored; a false positive "
        "counts in the stratum of its own range and points, and in every stratum of occlusion",
        ("by", "stratum"),
        title="Results by range, LiDAR points and occlusion",
    ),
    Formula(
        "kitti_difficulty",
        "KITTI's levels easy, moderate and hard are defined in a camera's image (height of the box "
        "in pixels, truncation); where no camera without distortion shows the evaluated clouds, or none was "
        "evaluated, AP is given by range, points and occlusion alone",
        title="KITTI's levels of difficulty",
    ),
    Formula(
        "chamfer",
        "CD(P, Q) = mean over p of min |p - q|^2 + mean over q of min |q - p|^2, in m^2; "
        "the mean over frames",
        ("chamfer_distance_m2",),
        title="Chamfer distance (CD)",
    ),
    Formula(
        "interval",
        "95 % percentile interval of a bootstrap over blocks of at least 5 s, drawn together for "
        "clean, adversarial and baseline clouds",
        ("*_ci95", "blocks"),
        title="95 % intervals",
    ),
    Formula(
        "baseline",
        "as many points removed, added or moved as far as by the attack, chosen at random: anywhere; "
        "near objects (within 0.5 m of a box) as far as there are such points; or, where points are moved, "
        "every point by the attack's bound. " + ABOUT_BASELINES,
        ("baselines", "random_best_*", "baseline_*", "baseline_near_*", "baseline_full_*", "baseline_tries"),
        title="Random baselines",
    ),
    Formula(
        "significant_vs_random",
        "the 95 % interval of the paired difference of mAP ratios to random-best lies below 0; with fewer "
        "than six blocks no interval is shown, and nothing is said of significance",
        ("significant_vs_random", "map_ratio_delta_points_vs_*", "map_loose_ratio_delta_points_vs_*"),
        title="Significance against random baselines",
    ),
    Formula(
        "attack_success",
        "100 % * objects lost / objects found on the clean clouds; at loose overlap, and "
        "beside it as strict_... at strict overlap, both with a score of at least the working_score",
        ("attack_success_percent", "strict_attack_success_percent"),
        title="Attack success and new false positives",
    ),
    Formula("white_box", WHITE_BOX, ("is_white_box", "attacked_against"), title="What the attacker knows"),
    Formula(
        "recounted",
        "the objects that have at least 5 points in the attacked cloud instead of the clean one",
        ("*_recounted",),
        title="Objects, recounted",
    ),
    Formula(
        "defence",
        "under a defence, clean and attacked clouds are changed before the detector sees them, by the "
        "same draws; objects are those of the clean clouds as recorded, and boxes are transformed back to "
        "their frame",
        ("defence", "clean_map_kept_percent", "map_adv_percent", "map_ratio_delta_points_vs_random_best"),
        title="Defences",
    ),
    Formula(
        "lost",
        "lost objects are found on the clean cloud and missed on the other, at loose IoU and at least "
        "the working_score (the best F1 on the clean clouds)",
        ("lost_objects", "working_score"),
        title="Lost objects",
    ),
    Formula(
        "displaced",
        "displaced objects are found on the clean cloud at strict overlap, and on the other one at loose "
        "overlap only, both with at least the working_score: the detector still sees that something is "
        "there, in the wrong place, size or direction",
        ("displaced_objects", "displaced_percent", "displaced"),
        title="Displaced objects",
    ),
)
"""What the values of detection mean."""

FORMULAS: Mapping[str, str] = {each.name: each.meaning for each in DEFINITIONS}
"""The meanings by name, as every report explains them."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Report(Evaluation):
    """An evaluation as people read it.

    sections: tables, pictures and records that families of attacks add. folder: the one with report.html and
    report.json; None before they are written.
    """

    sections: tuple[ReportSection, ...] = ()
    folder: Path | None = None

    def __str__(self) -> str:
        """The report's folder, and the mAP ratio of each adversarial bag and detector."""
        ratios = [
            f"{row.bag} {formatted_number(row.attacked.map_ratio_percent, 2)} % of the clean mAP"
            if row.attacked.map_ratio_percent == row.attacked.map_ratio_percent
            else f"{row.bag} mAP ratio {undefined_ratio(row.clean.means['strict'].map_r40)}"
            for row in self.results
            if row.attacked
        ]
        summary = ratios or [section.title for section in self.sections] or ["clean bag alone"]
        return f"{self.folder}: {'; '.join(summary)}"

    def _repr_html_(self) -> str:
        """The tables of report.html."""
        from advpipe.stages.evaluate.report.notebook import notebook_html

        return notebook_html(self)

    @property
    def definitions(self) -> tuple[Formula, ...]:
        """The formulas of this report with their titles, in their order."""
        known = {each.name: each for each in DEFINITIONS}
        known |= {each.name: each for section in self.sections for each in section.formulas}
        return tuple(
            known.get(name, Formula(name, meaning))._replace(meaning=meaning)
            for name, meaning in self.formulas.items()
        )

    def listed(self, kind: type[T]) -> list[T]:
        """The records of a kind, of all sections."""
        return [each for section in self.sections for each in section.records if isinstance(each, kind)]


def report_of(
    summaries: Sequence[Summary],
    sections: Sequence[ReportSection],
    origin: ResultsOrigin,
    formulas: Mapping[str, str],
    warnings: Sequence[str],
) -> Report:
    """The report of scored comparisons; the formulas of sections join the others."""
    of_sections = {each.name: each.meaning for section in sections for each in section.formulas}
    return Report(
        results=tuple(summary.result for summary in summaries),
        origin=origin,
        formulas={**formulas, **of_sections},
        average_precision=precision_records(summaries),
        records={each.key: each.records for each in sections if each.records},
        warnings=tuple(warnings),
        sections=tuple(sections),
    )


def precision_records(summaries: Sequence[Summary]) -> tuple[PrecisionRecord, ...]:
    """What `report.json` lists as `average_precision`."""
    return tuple(
        PrecisionRecord(
            summary.result.bag,
            summary.result.detector,
            condition,
            each.name,
            each.criterion,
            each.by,
            each.stratum,
            each.boxes,
            each.ap_r40,
            each.ap_r40_ci95,
            each.ap_r11,
        )
        for summary in summaries
        for condition, precisions in summary.precisions.items()
        for each in precisions
    )
