"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import has_ground_truth
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.partial import FolderKind, staged_folder
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.looking import Looking
from advpipe.stages.evaluate.detection.scoring import known_classes
from advpipe.stages.evaluate.detection.summary import summarise
from advpipe.stages.evaluate.detection.write_back import write_detections
from advpipe.stages.evaluate.provenance import (
    describe_bags,
    describe_detector,
    transfer_remark,
)
from advpipe.stages.evaluate.report.html import write_html
from advpipe.stages.evaluate.report.pictures import draw_pictures
from advpipe.stages.evaluate.report.report import FORMULAS, Report, precision_records
from advpipe.stages.evaluate.report.results import write_frames, write_results
from advpipe.stages.evaluate.report.table import print_report

__all__ = ["Report", "evaluate", "print_report"]

REPORT = FolderKind(
    "report",
    ("report.json", "results.parquet", "frames.parquet", "figures", "report.html", "detections"),
    ("report.json",),
)


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
    lidar_topic: str | None = None,
    workers: int | None = None,
    detections: bool = False,
    with_clouds: bool = False,
) -> Report:
    """Score a detector on a clean bag and on adversarial versions of it, and write a report.

    An adversarial bag may hold some of the frames only; its clean figures are those of the same
    frames. Without adversarial bags all clean frames are scored. `out` becomes a folder with
    report.html, report.json, results.parquet (every detection and every object), frames.parquet and
    figures/; with `detections` also detections/, a bag to view for each bag, which holds the clouds too
    if `with_clouds` says so. `lidar_topic`: the clouds, where a bag has those of several LiDARs.
    `workers` processes detect, by default one for each core; their number changes no byte.

    Raises AdvpipeError for bags that do not belong together, lack clouds or ground truth, for an unknown
    detector and for an existing `out`.
    """
    parent = _checked_clean(clean, lidar_topic)
    provenances = [_checked_adversarial(bag, clean, parent) for bag in adversarial]
    _refuse_equal_names(adversarial)
    model = load_detector(detector)
    with staged_folder(out, overwrite, REPORT) as folder:
        looking = Looking(
            detector, clean, tuple(adversarial), tuple(provenances), lidar_topic, seed, baseline
        )
        comparisons = looking.comparisons(workers)
        digest = detector_sha256(detector)
        summaries = [
            summarise(each, known_classes(model), bootstrap_draws, seed, transfer_remark(each, digest))
            for each in comparisons
        ]
        about = describe_detector(detector, model, digest)
        origin = {
            "bootstrap_draws": bootstrap_draws,
            "seed": seed,
            "detector": about,
            **describe_bags(clean, parent, comparisons),
        }
        rows = tuple(summary.row for summary in summaries)
        report = Report(rows, origin, FORMULAS, precision_records(summaries))
        (folder / "report.json").write_text(report.to_json(), encoding="utf-8")
        write_results(summaries, folder / "results.parquet")
        write_frames(summaries, folder / "frames.parquet")
        pictures = draw_pictures(clean, summaries, folder / "figures", lidar_topic)
        write_html(report, summaries, pictures, folder / "report.html")
        if detections:
            _write_detections(clean, comparisons, folder / "detections", about, lidar_topic, with_clouds)
    return report


def _write_detections(
    clean: Path,
    comparisons: Sequence[Comparison],
    folder: Path,
    detector: Row,
    lidar_topic: str | None,
    with_clouds: bool,
) -> None:
    """A bag of the clean bag's detections, and one for each adversarial bag."""
    found = {frame.index: frame.clean.detections for each in comparisons for frame in each.frames}
    bags = [(clean, "clean", found)]
    for each in comparisons:
        frames = [(frame.adversarial_index, frame.adversarial) for frame in each.frames]
        if each.bag:
            bags.append((each.bag, each.name, {index: seen.detections for index, seen in frames if seen}))
    for source, name, detections in bags:
        write_detections(
            source, folder / name, detections, detector, lidar_topic=lidar_topic, with_clouds=with_clouds
        )


def _checked_clean(clean: Path, lidar_topic: str | None) -> str:
    """The SHA-256 of a clean bag that can be evaluated."""
    if BagReader(clean).provenance.get("kind") == "attack":
        raise AdvpipeError(
            f"{clean} is an adversarial bag; give the clean bag that it was made from first, then this one"
        )
    if not has_ground_truth(clean, lidar_topic):
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
