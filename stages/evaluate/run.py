"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import has_ground_truth
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.files import staged_folder
from advpipe.pipeline.versions import installed
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name, compare, look_at_clean
from advpipe.stages.evaluate.detection.scoring import Eye
from advpipe.stages.evaluate.detection.summary import Row, Summary, summarise
from advpipe.stages.evaluate.report.html import write_html
from advpipe.stages.evaluate.report.pictures import draw_pictures
from advpipe.stages.evaluate.report.report import FORMULAS, Report, write_results
from advpipe.stages.evaluate.report.table import print_report

__all__ = ["Report", "evaluate", "print_report"]


def evaluate(
    clean: Path,
    adversarial: Sequence[Path],
    out: Path,
    *,
    detector: str = "small",
    seed: int = 0,
    baseline: bool = True,
    overwrite: bool = False,
    bootstrap_draws: int = 1000,
) -> Report:
    """Score a detector on a clean bag and on adversarial versions of it, and write a report.

    An adversarial bag may hold some of the frames only; its clean figures are those of the same
    frames. Without adversarial bags all clean frames are scored. `out` becomes a folder with
    report.html, report.json, results.parquet and figures/. Raises AdvpipeError for bags that do not
    belong together, lack clouds or ground truth, for an unknown detector and for an existing `out`.
    """
    parent = _checked_clean(clean)
    provenances = [_checked_adversarial(bag, clean, parent) for bag in adversarial]
    model = load_detector(detector)
    with staged_folder(out, overwrite) as folder:
        eye = Eye(model)
        comparisons = [
            compare(clean, bag, provenance, eye, seed, baseline)
            for bag, provenance in zip(adversarial, provenances, strict=True)
        ] or [look_at_clean(clean, eye)]
        summaries = [summarise(each, eye.classes, bootstrap_draws, seed) for each in comparisons]
        origin = _provenance(clean, parent, summaries, detector, model) | {
            "seed": seed,
            "bootstrap_draws": bootstrap_draws,
        }
        report = Report(tuple(summary.row for summary in summaries), origin, FORMULAS)
        (folder / "report.json").write_text(report.to_json(), encoding="utf-8")
        write_results(summaries, folder / "results.parquet")
        pictures = draw_pictures(clean, summaries, folder / "figures")
        write_html(report, pictures, folder / "report.html")
    return report


def _checked_clean(clean: Path) -> str:
    """The SHA-256 of a clean bag that can be evaluated."""
    if not has_ground_truth(clean):
        raise AdvpipeError(
            f"{clean} has no ground truth (no vision_msgs/msg/Detection3DArray topic); "
            "give the clean bag that holds it"
        )
    return parent_sha256(clean)


def _checked_adversarial(bag: Path, clean: Path, clean_sha256: str) -> dict[str, str]:
    """The provenance of an adversarial bag that was made from the clean one."""
    provenance = BagReader(bag).provenance
    if provenance.get("parent_sha256", clean_sha256) != clean_sha256:
        raise AdvpipeError(
            f"{bag} was made from another bag than {clean} (parent SHA-256 "
            f"{provenance['parent_sha256'][:12]}…, not {clean_sha256[:12]}…); give the bag that was attacked"
        )
    return provenance


def _provenance(
    clean: Path, clean_sha256: str, summaries: Sequence[Summary], detector: str, model: Detector
) -> Row:
    """Where the figures come from: enough to compute them again."""
    scenario = BagReader(clean).provenance
    return {
        "advpipe": installed("advpipe"),
        "clean": {"bag": bag_name(clean), "sha256": clean_sha256, "scenario": scenario.get("scenario_name")},
        "compared": [_compared(summary.comparison) for summary in summaries],
        "detector": {
            "name": Path(detector).name,
            "classes": list(model.classes),
            "checkpoint_sha256": _checkpoint_sha256(detector),
            "range_m": vars(model.range_m),
        },
    }


def _compared(comparison: Comparison) -> Row:
    """A bag and the frames of it that were scored, counted in the clean bag."""
    own = {key: value for key, value in comparison.provenance.items() if key != "scenario"}
    return {
        "bag": comparison.name,
        "sha256": parent_sha256(comparison.bag) if comparison.bag else None,
        "provenance": own,
        "frames": [frame.index for frame in comparison.frames],
    }


def _checkpoint_sha256(detector: str) -> str | None:
    """The SHA-256 of the weights' file; None for a detector given as `module:Class`."""
    from advpipe.pipeline.detector.second.checkpoint import SHIPPED

    path = SHIPPED.get(detector, Path(detector))
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None
