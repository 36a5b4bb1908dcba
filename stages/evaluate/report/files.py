"""The files of a report, in a folder that is not there under its own name until all of them are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from advpipe.pipeline.core.partial import FolderKind
from advpipe.pipeline.results.origin import DetectorOrigin
from advpipe.pipeline.viewer.page import viewer_html
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.detection.write_back import write_detections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.html import write_html
from advpipe.stages.evaluate.report.pictures import draw_pictures
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.results import write_frames, write_results
from advpipe.stages.evaluate.report.viewer_scenes import viewer_scenes

REPORT = FolderKind(
    "report",
    (
        *("report.json", "results.parquet", "frames.parquet", "verdicts.parquet", "figures"),
        *("report.html", "detections"),
    ),
    ("report.json",),
)


def write_report(
    report: Report, summaries: Sequence[Summary], clean: Path, folder: Path, options: Options
) -> None:
    """report.json, the tables, figures/, report.html and, if they are asked for, detections/."""
    (folder / "report.json").write_text(report.to_json(), encoding="utf-8")
    if summaries:
        write_results(summaries, folder / "results.parquet")
        write_frames(summaries, folder / "frames.parquet")
    for name, content in (each for section in report.sections for each in section.files.items()):
        (folder / name).write_bytes(content)
    pictures = draw_pictures(clean, summaries, options.lidar_topic)
    (folder / "figures").mkdir()
    for picture in [*pictures, *(picture for section in report.sections for picture in section.pictures)]:
        for name, content in picture.files.items():
            (folder / "figures" / name).write_bytes(content)
    scenes = viewer_scenes(clean, of_first_detector(summaries), options.lidar_topic) if options.scene else []
    write_html(report, summaries, pictures, folder / "report.html", viewer_html(scenes))
    if options.detections and summaries:
        comparisons = [summary.comparison for summary in of_first_detector(summaries)]
        _write_detections(clean, comparisons, folder / "detections", report.origin.detectors[0], options)


def _write_detections(
    clean: Path, comparisons: Sequence[Comparison], folder: Path, detector: DetectorOrigin, options: Options
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
            source,
            folder / name,
            detections,
            asdict(detector),
            lidar_topic=options.lidar_topic,
            with_clouds=options.with_clouds,
        )
