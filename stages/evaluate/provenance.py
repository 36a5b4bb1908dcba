"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.attack_detection.registry import chosen_sequence_checks, parse_attack_checks
from advpipe.pipeline.bag.frames import FrameSlice, find_lidar_topic, read_frames
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.code import CLOUDS, code_sha256
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.device import device_record
from advpipe.pipeline.detector.expected_input import BRIGHTEST
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import detector_sha256
from advpipe.pipeline.results.origin import (
    AdaptationRecord,
    CleanBag,
    ComparedBag,
    DetectorOrigin,
    ResultsOrigin,
)
from advpipe.stages.evaluate.bags import Bags
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.training_map import MapStatus

SCORING = (
    *CLOUDS,
    "pipeline/messages/cloud_difference.py",
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
    "pipeline/image_detector",
    "pipeline/image_labels",
    "pipeline/kitti",
    "pipeline/localisation",
    "pipeline/misbehaviour",
    "pipeline/scenario/attacks.py",
    "pipeline/sensors/camera/lens.py",
    "pipeline/sensors/radar",
    "pipeline/sensors/world.py",
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
    adaptation = options.adaptation
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
        defences=tuple(parse_defences(options.defences)),
        attack_checks=(
            *parse_attack_checks(options.detect_attacks),
            *chosen_sequence_checks(options.detect_attacks),
        ),
        device=device_record(options.device).get("device"),
        adaptation=None if adaptation.is_none else AdaptationRecord(**vars(adaptation)),
    )


def comparison_warnings(comparison: Comparison, clean: Path, options: Options) -> list[str]:
    """What a reader has to know before the metrics of a comparison.

    The attack was made against another detector, other clouds or a detector that saw them otherwise; clouds
    were not levelled; or the first clean cloud has intensities on another scale than advpipe's.
    """
    warnings, topic = [], find_lidar_topic(BagReader(clean), options.lidar_topic)
    adaptation = options.adaptation
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
    if brightest * adaptation.scale_intensity > BRIGHTEST:
        warnings.append(
            f"Intensities go up to {brightest:g}. Those of advpipe's drives, on which the shipped detector "
            "was trained, go from 0 to 1: it may find less than in clouds of that scale "
            f"({option_name('scale_intensity')})."
        )
    warnings += _other_adaptation(comparison, adaptation)
    if notes := Counter(frame.note for frame in comparison.frames if frame.note):
        (note, _), *_ = notes.most_common(1)
        warnings.append(f"{notes.total()} of {len(comparison.frames)} clouds were {note}.")
    return warnings


def _other_adaptation(comparison: Comparison, adaptation: Adaptation) -> list[str]:
    """A warning where the attacked detector saw clouds otherwise than the evaluated one."""
    for one in comparison.provenance.fields.attacks:
        if one.family == "lidar":
            values = vars(Adaptation()) | {
                key: value for key, value in one.values.items() if key in vars(adaptation)
            }
            if values != vars(adaptation):
                return [
                    "The attack was made against a detector that saw clouds otherwise: "
                    f"{_settings(values)}, not {_settings(vars(adaptation))}."
                ]
    return []


def _settings(values: Mapping[str, object]) -> str:
    """Such as `with --lidar-height 2.2, --level`."""
    default = vars(Adaptation())
    given = [option_name(key, value) for key, value in values.items() if value != default[key]]
    return f"with {', '.join(given)}" if given else "as recorded"
