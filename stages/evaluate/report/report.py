"""The report of an evaluation: its figures, where they come from, and the files that hold them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.section import Section

FORMULAS: Mapping[str, str] = {
    "ap": "AP = (1/40) * sum over r in {1/40, ..., 1} of max precision at recall >= r (R40); R11 reads "
    "precision at r in {0, 0.1, ..., 1} instead",
    "map": "mAP = mean AP over the classes with at least 50 evaluated boxes in the scored clean frames",
    "map_ratio": "mAP ratio = 100 % * mAP(adversarial clouds) / mAP(clean clouds), on the same frames",
    "iou": "strict 3D IoU: car and truck 0.7, cyclist and pedestrian 0.5; loose: 0.5 and 0.25",
    "ignored": "no object counts with fewer than 5 points in the clean cloud or with its centre out of the "
    "detector's range in the plane, and no detection that finds one, nor one out of that range",
    "strata": "by range (of the centre, in the plane), by LiDAR points in the clean cloud and by the share "
    "hidden, as recorded: objects of other strata are ignored, and so is what finds them; a false positive "
    "counts in the stratum of its own range and points, and in every stratum of occlusion",
    "kitti_difficulty": "KITTI's easy, moderate and hard are defined in a camera's image (height of the box "
    "in pixels, truncation), which there is none of here: AP by range, points and occlusion is given instead",
    "chamfer": "CD(P, Q) = mean over p of min |p - q|^2 + mean over q of min |q - p|^2, in m^2; "
    "the mean over frames",
    "interval": "95 % percentile interval of a bootstrap over blocks of at least 5 s, drawn together for "
    "clean, adversarial and baseline clouds",
    "baseline": "as many points removed, added or moved as far as by the attack, chosen at random: anywhere; "
    "near objects (within 0.5 m of a box) as far as there are such points; or, where points are moved, every "
    "point by the attack's bound; best try: of as many tries as the attack looked at (or as stated) the one "
    "that hides most, chosen for each object by the detector's own result, and put together",
    "beats_random": "the 95 % interval of the paired difference of mAP ratios to every baseline lies below 0",
    "attack_success": "100 % * objects lost / objects found on the clean clouds",
    "recounted": "the objects that have at least 5 points in the attacked cloud instead of the clean one",
    "defence": "under a defence, clean and attacked clouds are changed before the detector sees them, by the "
    "same draws; objects are those of the clean clouds as recorded, and boxes come back to their frame",
    "lost": "lost objects are found on the clean cloud and missed on the other, at loose IoU and at least "
    "the working_score (the best F1 on the clean clouds)",
}
"""What the figures mean, in words that go into every report."""

SIGNIFICANT_DIGITS = 8


@dataclass(frozen=True)
class Report:
    """All figures of an evaluation.

    rows: one an adversarial bag, or one for the clean bag alone. provenance: detector, bags, seeds.
    average_precision: one record a bag, detector, cloud (`clean`, `adv`, or a baseline's word), class,
    criterion and stratum. sections: what every family adds; the records of each are listed by its key.
    """

    rows: tuple[Row, ...]
    provenance: Row
    formulas: Mapping[str, str]
    average_precision: tuple[Row, ...] = ()
    sections: tuple[Section, ...] = ()

    def to_json(self) -> str:
        """The same text for the same figures: sorted keys, rounded numbers, null for what is undefined.

        The records of `average_precision` and of sections take one line each.
        """
        document = {"formulas": self.all_formulas(), "provenance": self.provenance, "rows": self.rows}
        text = json.dumps(plain(document), indent=2, sort_keys=True, allow_nan=False)
        records = {"average_precision": self.average_precision}
        records |= {each.key: each.records for each in self.sections if each.records}
        listed = "".join(f'\n  "{key}": {_one_a_line(each)},' for key, each in sorted(records.items()))
        return f"{{{listed}{text[1:]}\n"

    def all_formulas(self) -> dict[str, str]:
        """What the figures mean, those of sections too."""
        formulas = dict(self.formulas)
        for section in self.sections:
            formulas |= dict(section.formulas)
        return formulas


def precision_records(summaries: Sequence[Summary]) -> tuple[Row, ...]:
    """What `report.json` lists as `average_precision`; of all objects: `by` is empty, `stratum` all."""
    return tuple(
        {
            "bag": summary.row["bag"],
            "detector": summary.row["detector"],
            "cloud": cloud,
            **{"class" if key == "name" else key: value for key, value in asdict(precision).items()},
        }
        for summary in summaries
        for cloud, precisions in summary.precisions.items()
        for precision in precisions
    )


def _one_a_line(records: Sequence[Row]) -> str:
    lines = [json.dumps(plain(record), sort_keys=True, allow_nan=False) for record in records]
    return "[" + ",".join(f"\n    {line}" for line in lines) + "\n  ]"


def plain(value: object) -> object:
    """A value that JSON knows: numbers rounded to `SIGNIFICANT_DIGITS`, None for NaN."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(value) else None
    return value
