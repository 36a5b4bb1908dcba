"""Stage 3: how much worse a detector sees on adversarial bags (section IV of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, find_lidar_topic
from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.partial import staged_folder
from advpipe.pipeline.core.progress import plan_progress, track, working_on
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.input_notice import notice_unexpected_input
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.evaluate.bags import Bags
from advpipe.stages.evaluate.camera.section import check_image_detector
from advpipe.stages.evaluate.cooperative.section import KEY as COOPERATIVE
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.summary import Summary, summarise
from advpipe.stages.evaluate.families import added_sections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.provenance import comparison_warnings, results_origin
from advpipe.stages.evaluate.report.attacked import attacked_sections
from advpipe.stages.evaluate.report.files import REPORT, write_report
from advpipe.stages.evaluate.report.report import FORMULAS, Report, report_of
from advpipe.stages.evaluate.report.terminal import print_report
from advpipe.stages.evaluate.training_map import map_status

__all__ = ["Options", "Report", "evaluate", "print_report"]

LOADING, METRICS, WRITING = "loading the detector", "metrics and their intervals", "writing the report"
"""The phases of an evaluation, beside those of its parts."""

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
    plan_progress(_plan(options))
    bags = Bags.checked(clean, adversarial, options)
    asked = options.detectors if bags.has_clouds_to_score else ()
    if asked:
        notice_default_lidar(BagReader(clean), options.lidar_topic)
    with working_on(LOADING):
        models = {name: load_detector(name, options.device) for name in asked}
        check_image_detector(clean, options.image_detector)
    for name, model in models.items():
        options.adaptation.check(model, name)
        topic = find_lidar_topic(BagReader(clean), options.lidar_topic)
        notice_unexpected_input(BagReader(clean), topic, name, model, options.adaptation)
    with staged_folder(out, overwrite, REPORT) as folder:
        clean_sha256 = parent_sha256(clean)  # hashes the whole bag, so after all that is refused at once
        bags.refuse_another_parent(clean_sha256)
        summaries: list[Summary] = []
        for name in models:
            with working_on(f"detector {name}"):
                plan_progress({"detecting": 20, METRICS: 3})
                comparisons = DetectionRun(name, clean, bags.on_clouds, options).comparisons(workers)
                for comparison in track(comparisons, METRICS, len(comparisons)):
                    warnings = comparison_warnings(comparison, clean, options)
                    summaries.append(summarise(comparison, options.bootstrap_draws, options.seed, warnings))
        sections = [*attacked_sections(summaries), *added_sections(clean, adversarial, options, summaries)]
        if not models and any(section.key == COOPERATIVE for section in sections):
            first = options.detectors[0]  # only that section needed a detector
            models = {first: load_detector(first, options.device)}
            options.adaptation.check(models[first], first)
        about_clean = BagReader(clean).provenance
        maps = {name: map_status(name, model, about_clean) for name, model in models.items()}
        chosen = {} if options.frames == ALL_FRAMES else {"frames": f"{options.frames}: {FRAMES}"}
        report = report_of(
            summaries,
            sections,
            results_origin(bags, clean_sha256, models, maps, summaries, options),
            {**FORMULAS, **chosen, **_adapted(options.adaptation)},
            [each.text for each in maps.values() if each.text],
        )
        with working_on(WRITING):
            write_report(report, summaries, clean, folder, options)
    return replace(report, folder=out)


def _plan(options: Options) -> dict[str, float]:
    """The phases with rough shares of the time; those of families that were not attacked are left out."""
    detectors = dict.fromkeys((f"detector {name}" for name in options.detectors), 60.0)
    families = {"coordinated attacks": 3, "localisation": 5, "V2X of each bag": 8, "radars": 3, "cameras": 10}
    return {LOADING: 3, **detectors, **families, "cooperative perception": 8, WRITING: 30}


def _adapted(adaptation: Adaptation) -> dict[str, str]:
    """What the report says of clouds that detectors do not see as they are."""
    text = adaptation.text
    return {"adaptation": text} if text else {}
