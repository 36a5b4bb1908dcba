"""The report of an evaluation: its figures, where they come from, and the files that hold them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.stages.evaluate.detection.summary import Row, Summary

FORMULAS: Mapping[str, str] = {
    "ap": "AP = (1/40) * sum over r in {1/40, ..., 1} of max precision at recall >= r",
    "map": "mAP = mean AP over the classes with at least 50 evaluated boxes in the scored clean frames",
    "map_ratio": "mAP ratio = 100 % * mAP(adversarial clouds) / mAP(clean clouds), on the same frames",
    "iou": "strict 3D IoU: car and truck 0.7, cyclist and pedestrian 0.5; loose: 0.5 and 0.25",
    "ignored": "no object counts with fewer than 5 points in the clean cloud or out of the detector's range",
    "chamfer": "CD(P, Q) = mean over p of min |p - q|^2 + mean over q of min |q - p|^2, in m^2; "
    "the mean over frames",
    "interval": "95 % percentile interval of a bootstrap over blocks of at least 5 s, drawn together for "
    "clean, adversarial and baseline clouds",
    "baseline": "as many points removed, added or moved as far as by the attack, chosen at random",
    "lost": "lost objects are found on the clean cloud and missed on the other, at loose IoU and at least "
    "the working_score (the best F1 on the clean clouds)",
}
"""What the figures mean, in words that go into every report."""

SIGNIFICANT_DIGITS = 8


@dataclass(frozen=True)
class Report:
    """All figures of an evaluation.

    rows: one an adversarial bag, or one for the clean bag alone. provenance: detector, bags, seeds.
    """

    rows: tuple[Row, ...]
    provenance: Row
    formulas: Mapping[str, str]

    def to_json(self) -> str:
        """The same text for the same figures: sorted keys, rounded numbers, null for what is undefined."""
        document = {"formulas": dict(self.formulas), "provenance": self.provenance, "rows": self.rows}
        return json.dumps(_plain(document), indent=2, sort_keys=True, allow_nan=False) + "\n"


def write_results(summaries: Sequence[Summary], path: Path) -> None:
    """`results.parquet`: one row a frame and bag."""
    rows = [
        {"bag": summary.row["bag"], "attack": summary.row["attack"], "recipe": summary.row["recipe"], **row}
        for summary in summaries
        for row in summary.per_frame
    ]
    schema = pa.schema([(name, _arrow_type(name)) for name in rows[0]])
    pq.write_table(pa.Table.from_pylist(rows, schema=schema), str(path))


def _arrow_type(column: str) -> pa.DataType:
    if column in ("bag", "attack", "recipe"):
        return pa.string()
    return pa.float64() if column.startswith(("max_displacement_m", "chamfer_distance_m2")) else pa.int64()


def _plain(value: object) -> object:
    """A value that JSON knows: numbers rounded to `SIGNIFICANT_DIGITS`, None for NaN."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(value) else None
    return value
