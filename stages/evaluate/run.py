"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import has_ground_truth
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.partial import FolderKind, staged_folder
from advpipe.stages.evaluate.detection.comparison import bag_name, compare, look_at_clean
from advpipe.stages.evaluate.detection.scoring import Eye
from advpipe.stages.evaluate.detection.summary import summarise
from advpipe.stages.evaluate.provenance import (
    describe_bags,
    describe_detector,
    transfer_remark,
)
from advpipe.stages.evaluate.report.html import write_html
from advpipe.stages.evaluate.report.pictures import draw_pictures
from advpipe.stages.evaluate.report.report import FORMULAS, Report, write_results
from advpipe.stages.evaluate.report.table import print_report

__all__ = ["Report", "evaluate", "print_report"]

REPORT = FolderKind("report", ("report.json", "results.parquet", "figures", "report.html"), ("report.json",))


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
    _refuse_equal_names(adversarial)
    model = load_detector(detector)
    with staged_folder(out, overwrite, REPORT) as folder:
        eye = Eye(model)
        with fixed_torch_threads():
            comparisons = [
                compare(clean, bag, provenance, eye, seed, baseline)
                for bag, provenance in zip(adversarial, provenances, strict=True)
            ] or [look_at_clean(clean, eye)]
        digest = detector_sha256(detector)
        summaries = [
            summarise(each, eye.classes, bootstrap_draws, seed, transfer_remark(each, digest))
            for each in comparisons
        ]
        origin = {
            "bootstrap_draws": bootstrap_draws,
            "seed": seed,
            "detector": describe_detector(detector, model, digest),
            **describe_bags(clean, parent, comparisons),
        }
        report = Report(tuple(summary.row for summary in summaries), origin, FORMULAS)
        (folder / "report.json").write_text(report.to_json(), encoding="utf-8")
        write_results(summaries, folder / "results.parquet")
        pictures = draw_pictures(clean, summaries, folder / "figures")
        write_html(report, pictures, folder / "report.html")
    return report


def _checked_clean(clean: Path) -> str:
    """The SHA-256 of a clean bag that can be evaluated."""
    if BagReader(clean).provenance.get("kind") == "attack":
        raise AdvpipeError(
            f"{clean} is an adversarial bag; give the clean bag that it was made from first, then this one"
        )
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
            f"{provenance['parent_sha256'][:12]}…, not {clean_sha256[:12]}…); "
            "give the bag that was attacked; if that was recorded anew since, "
            "attack again with --overwrite or remove that folder"
        )
    return provenance


def _refuse_equal_names(bags: Sequence[Path]) -> None:
    names = [bag_name(bag) for bag in bags]
    for name in names:
        if names.count(name) > 1:
            raise AdvpipeError(
                f"two adversarial bags are named {name}; rename one, the report tells them by name"
            )
