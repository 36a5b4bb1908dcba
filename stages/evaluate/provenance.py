"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, find_lidar_topic, read_frames
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.code import CLOUDS, code_sha256
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.detector.device import device_record
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import detector_sha256
from advpipe.pipeline.results.origin import CleanBag, ComparedBag, DetectorOrigin, ResultsOrigin
from advpipe.stages.evaluate.bags import Bags
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.training_map import MapStatus

SCORING = (
    *CLOUDS,
    "pipeline/messages/cloud_difference.py",
    "pipeline/defences",
    "pipeline/results",
    "stages/evaluate/detection",
    "stages/evaluate/options.py",
)
"""The code that decides the figures of detection."""

REPORTING = (
    *SCORING,
    "pipeline/bag",
    "pipeline/labels",
    "pipeline/messages",
    "pipeline/replay",
    "pipeline/kitti",
    "pipeline/localisation",
    "pipeline/misbehaviour",
    "pipeline/scenario/attacks.py",
    "pipeline/v2x",
    "stages/evaluate",
)
"""The code that decides the contents of a report."""


def results_origin(
    bags: Bags,
    clean_sha256: str,
    models: Mapping[str, ObjectDetector],
    maps: Mapping[str, MapStatus],
    summaries: Sequence[Summary],
    options: Options,
) -> ResultsOrigin:
    """Bags with their checksums and records, detectors, options and code.

    The bags that were scored come first, each with its frames of the clean bag; then those whose clouds
    nobody attacked. models, maps: by the name of the detector.
    """
    scored = [summary.comparison for summary in of_first_detector(summaries)]
    unseen = [
        Comparison(bag, about, ()) for bag, about in bags.provenances.items() if bag not in bags.on_clouds
    ]
    return ResultsOrigin(
        advpipe=installed("advpipe"),
        code_sha256=code_sha256(*REPORTING),
        clean=CleanBag(
            bag_name(bags.clean), clean_sha256, BagReader(bags.clean).provenance.get("scenario_name")
        ),
        compared=tuple(
            ComparedBag(
                each.name,
                parent_sha256(each.bag) if each.bag else None,
                {key: value for key, value in each.provenance.items() if key != "scenario"},
                tuple(frame.index for frame in each.frames),
            )
            for each in (*scored, *unseen)
        ),
        detectors=tuple(
            DetectorOrigin(
                name=Path(name).name,
                sha256=detector_sha256(name),
                classes=tuple(model.classes),
                range_m=vars(model.range_m),
                is_training_map=maps[name].is_training_map,
            )
            for name, model in models.items()
        ),
        bootstrap_draws=options.bootstrap_draws,
        seed=options.seed,
        baseline_tries=options.baseline_tries if options.baseline else 0,
        defences=options.defences,
        device=device_record(options.device).get("device"),
    )


def comparison_warnings(comparison: Comparison, clean: Path, lidar_topic: str | None) -> list[str]:
    """What a reader has to know before the metrics of a comparison.

    The attack was made against another detector or other clouds, or the first clean cloud has intensities on
    another scale than advpipe's.
    """
    warnings, topic = [], find_lidar_topic(BagReader(clean), lidar_topic)
    if comparison.is_white_box is False:
        attacked = comparison.provenance.get("detector", "another detector")
        warnings.append(
            f"Attacked against {attacked}, evaluated with {comparison.detector}: this is a transfer attack."
        )
    topics = comparison.provenance.fields.lidar_topics
    if topics and topic not in topics:
        warnings.append(f"Attacked were the clouds of {', '.join(topics)}, evaluated were those of {topic}.")
    (first,) = read_frames(clean, FrameSlice(0, 1), lidar_topic=topic)
    brightest = float(np.nanmax(first.cloud["intensity"], initial=0.0))
    if brightest > 1.0:
        warnings.append(
            f"Intensities go up to {brightest:g}. Those of advpipe's drives, on which the shipped detector "
            "was trained, go from 0 to 1: it may find less than in clouds of that scale."
        )
    return warnings
