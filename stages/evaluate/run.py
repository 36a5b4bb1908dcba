"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, find_lidar_topic
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.partial import staged_folder
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.evaluate.bags import Bags
from advpipe.stages.evaluate.cooperative.section import KEY as COOPERATIVE
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.scoring import known_classes
from advpipe.stages.evaluate.detection.summary import Summary, summarise
from advpipe.stages.evaluate.families import added_sections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.provenance import (
    intensity_warning,
    results_origin,
    topic_warning,
    transfer_warning,
)
from advpipe.stages.evaluate.report.attacked import attacked_sections
from advpipe.stages.evaluate.report.files import REPORT, write_report
from advpipe.stages.evaluate.report.report import FORMULAS, Report, report_of
from advpipe.stages.evaluate.report.terminal import print_report
from advpipe.stages.evaluate.training_map import map_status

__all__ = ["Options", "Report", "evaluate", "print_report"]

FRAMES = (
    "detection and cooperative perception are of the chosen clouds; localisation, V2X and coordinated "
    "attacks are of the window from the first of these to one period after the last, in which a step leaves "
    "out clouds alone"
)


def evaluate(
    clean: Path,
    adversarial: Sequence[Path],
    out: Path,
    options: Options | None = None,
    *,
    overwrite: bool = False,
    workers: int | None = None,
) -> Report:
    """Score detectors on a clean bag and on adversarial versions of it, and write a report.

    An adversarial bag may hold some of the frames only; its clean figures are those of the same
    frames. Without adversarial bags all clean frames are scored. `out` becomes a folder with
    report.html, report.json, results.parquet (every detection and every object), frames.parquet and
    figures/; with `options.detections` also detections/, a bag to view for each bag. `workers` processes
    detect, by default one for each core; their number changes no byte. A bag whose attacks left the clouds
    alone is not shown to detectors.

    Raises AdvpipeError for bags that do not belong together, lack clouds or ground truth, for an unknown
    detector or defence and for an existing `out`.
    """
    options = options or Options()
    bags = Bags.checked(clean, adversarial, options)
    asked = options.detectors if bags.has_clouds_to_score else ()
    models = {name: load_detector(name, options.device) for name in asked}
    with staged_folder(out, overwrite, REPORT) as folder:
        clean_sha256 = parent_sha256(clean)  # whole bags are hashed last: what can be refused at once is
        bags.refuse_another_parent(clean_sha256)
        summaries = [
            summary
            for name, model in models.items()
            for summary in _score(bags, name, model, options, workers)
        ]
        sections = [*attacked_sections(summaries), *added_sections(clean, adversarial, options, summaries)]
        if not models and any(section.key == COOPERATIVE for section in sections):
            first = options.detectors[0]  # it looked for that section alone
            models = {first: load_detector(first, options.device)}
        about_clean = BagReader(clean).provenance
        maps = {name: map_status(name, model, about_clean) for name, model in models.items()}
        chosen = options.frames
        report = report_of(
            summaries,
            sections,
            results_origin(bags, clean_sha256, models, maps, summaries, options),
            FORMULAS if chosen == ALL_FRAMES else {**FORMULAS, "frames": f"{chosen}: {FRAMES}"},
            [each.text for each in maps.values() if each.text],
        )
        write_report(report, summaries, clean, folder, options)
    return replace(report, folder=out)


def _score(
    bags: Bags, name: str, model: ObjectDetector, options: Options, workers: int | None
) -> Iterator[Summary]:
    """What one detector makes of each adversarial bag whose clouds were attacked, or of the clean bag."""
    run = DetectionRun(
        name,
        bags.clean,
        bags.on_clouds,
        tuple(bags.provenances[bag] for bag in bags.on_clouds),
        options.lidar_topic,
        options.seed,
        options.baseline,
        options.baseline_tries,
        options.defences,
        options.frames,
        options.device,
    )
    comparisons = run.comparisons(workers)
    topic = find_lidar_topic(BagReader(bags.clean), options.lidar_topic)
    classes, draws, seed = known_classes(model), options.bootstrap_draws, options.seed
    for each in track(comparisons, "metrics and their intervals", len(comparisons)):
        warnings = [
            *transfer_warning(each),
            *topic_warning(each, topic),
            *intensity_warning(bags.clean, topic),
        ]
        yield summarise(each, classes, draws, seed, warnings)
