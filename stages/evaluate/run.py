"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, find_lidar_topic
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.code import code_sha256
from advpipe.pipeline.core.partial import staged_folder
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.detector.device import device_record
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.results.origin import Origin
from advpipe.stages.evaluate.bags import Bags
from advpipe.stages.evaluate.cooperative.section import KEY as COOPERATIVE
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.scoring import known_classes
from advpipe.stages.evaluate.detection.summary import Summary, summarise
from advpipe.stages.evaluate.families import added_sections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.provenance import (
    REPORTING,
    clean_bag,
    compared_bags,
    detector_origin,
    intensity_remark,
    topic_remark,
    transfer_remark,
)
from advpipe.stages.evaluate.report.attacked import attacked_sections
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.files import REPORT, write_report
from advpipe.stages.evaluate.report.report import FORMULAS, Report, report_of
from advpipe.stages.evaluate.report.table import print_report
from advpipe.stages.evaluate.training_map import MapStatus, map_status

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
    models = _load(options) if bags.has_clouds_to_score else {}
    with staged_folder(out, overwrite, REPORT) as folder:
        clean_sha256 = parent_sha256(clean)  # whole bags are hashed last: what can be refused at once is
        bags.refuse_another_parent(clean_sha256)
        summaries = [
            summary
            for name, model in models.items()
            for summary in _score(bags, name, model, options, workers)
        ]
        sections = [*attacked_sections(summaries), *added_sections(clean, adversarial, options)]
        if not models and any(section.key == COOPERATIVE for section in sections):
            models = _load(options, at_most=1)  # it looked for that section alone
        about_clean = BagReader(clean).provenance
        maps = {name: map_status(name, model, about_clean) for name, model in models.items()}
        report = report_of(
            summaries,
            sections,
            _origin(bags, clean_sha256, models, maps, summaries, options),
            FORMULAS
            if options.frames == ALL_FRAMES
            else {**FORMULAS, "frames": f"{options.frames}: {FRAMES}"},
            [each.text for each in maps.values() if each.text],
        )
        write_report(report, summaries, clean, folder, options)
    return replace(report, folder=out)


def _load(options: Options, at_most: int | None = None) -> dict[str, Detector]:
    return {name: load_detector(name, options.device) for name in options.detectors[:at_most]}


def _score(bags: Bags, name: str, model: Detector, options: Options, workers: int | None) -> list[Summary]:
    """What one detector makes of each adversarial bag whose clouds were attacked, or of the clean bag."""
    comparisons = _detection_run(bags, name, options).comparisons(workers)
    topic = find_lidar_topic(BagReader(bags.clean), options.lidar_topic)
    return [
        summarise(
            each,
            known_classes(model),
            options.bootstrap_draws,
            options.seed,
            [*transfer_remark(each), *topic_remark(each, topic), *intensity_remark(bags.clean, topic)],
        )
        for each in track(comparisons, "figures and their intervals", len(comparisons))
    ]


def _detection_run(bags: Bags, detector: str, options: Options) -> DetectionRun:
    return DetectionRun(
        detector,
        bags.clean,
        tuple(bags.on_clouds),
        tuple(bags.provenances[bag] for bag in bags.on_clouds),
        options.lidar_topic,
        options.seed,
        options.baseline,
        options.baseline_tries,
        options.defences,
        options.frames,
        options.device,
    )


def _origin(
    bags: Bags,
    clean_sha256: str,
    models: Mapping[str, Detector],
    maps: Mapping[str, MapStatus],
    summaries: Sequence[Summary],
    options: Options,
) -> Origin:
    """Where the figures come from: bags, detectors, options and code."""
    scored: list[Comparison] = [summary.comparison for summary in of_first_detector(summaries)]
    unseen = [bag for bag in bags.adversarial if bag not in bags.on_clouds]
    return Origin(
        advpipe=installed("advpipe"),
        code_sha256=code_sha256(*REPORTING),
        clean=clean_bag(bags.clean, clean_sha256),
        compared=compared_bags(scored, unseen),
        detectors=tuple(
            detector_origin(name, model, maps[name].is_training_map) for name, model in models.items()
        ),
        bootstrap_draws=options.bootstrap_draws,
        seed=options.seed,
        baseline_tries=options.baseline_tries if options.baseline else 0,
        defences=options.defences,
        device=device_record(options.device).get("device"),
    )
