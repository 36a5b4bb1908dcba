"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.code import CLOUDS, code_sha256
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.detector.protocol import Detector
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name
from advpipe.stages.evaluate.detection.figures import Row

SCORING = (*CLOUDS, "pipeline/defences", "stages/evaluate/detection")
"""The code that decides the figures of detection."""

REPORTING = (
    *SCORING,
    "pipeline/bag",
    "pipeline/labels",
    "pipeline/messages",
    "pipeline/replay",
    "pipeline/localisation",
    "pipeline/misbehaviour",
    "pipeline/scenario/attacks.py",
    "pipeline/v2x",
    "stages/evaluate",
)
"""The code that decides what a report says."""


def describe_bags(
    clean: Path, clean_sha256: str, comparisons: Sequence[Comparison], others: Sequence[Path]
) -> Row:
    """The bags, their checksums, and which frames of them were scored, counted in the clean bag.

    others: bags whose clouds nobody attacked, and of which none were scored.
    """
    unseen = [Comparison(bag, BagReader(bag).provenance, ()) for bag in others]
    scenario = BagReader(clean).provenance.get("scenario_name")
    return {
        "advpipe": installed("advpipe"),
        "code_sha256": code_sha256(*REPORTING),
        "clean": {"bag": bag_name(clean), "sha256": clean_sha256, "scenario": scenario},
        "compared": [
            {
                "bag": each.name,
                "sha256": parent_sha256(each.bag) if each.bag else None,
                "provenance": {key: value for key, value in each.provenance.items() if key != "scenario"},
                "frames": [frame.index for frame in each.frames],
            }
            for each in (*comparisons, *unseen)
        ],
    }


def describe_detector(name: str, detector: Detector, sha256: str, is_training_map: bool | None = None) -> Row:
    """The detector by name, checksum (see `detector_sha256`), classes and range, and whether it was trained
    on drives on the map of the clean bag; None where nobody can say."""
    return {
        "name": Path(name).name,
        "sha256": sha256,
        "classes": list(detector.classes),
        "range_m": vars(detector.range_m),
        "is_training_map": is_training_map,
    }


def transfer_remark(comparison: Comparison) -> list[str]:
    """A remark if the attack was made against another detector than the one that is scored."""
    if comparison.is_white_box is not False:
        return []
    attacked = comparison.provenance.get("detector", "another detector")
    return [f"Attacked against {attacked}, evaluated with {comparison.detector}: this is a transfer attack."]


def topic_remark(comparison: Comparison, topic: str) -> list[str]:
    """A remark if the clouds that are scored, those of a topic, are not the ones that were attacked."""
    attacked = comparison.provenance.said.lidar_topics
    if not attacked or topic in attacked:
        return []
    return [f"Attacked were the clouds of {', '.join(attacked)}, evaluated were those of {topic}."]


def intensity_remark(clean: Path, topic: str) -> list[str]:
    """A remark if the first cloud of a topic has intensities on another scale than advpipe's."""
    (frame,) = read_frames(clean, FrameSlice(0, 1), lidar_topic=topic)
    most = float(np.nanmax(frame.cloud["intensity"], initial=0.0))
    if most <= 1.0:
        return []
    return [
        f"Intensities go up to {most:g}. Those of advpipe's drives, on which the shipped detector was "
        "trained, go from 0 to 1: it may find less than in clouds of that scale."
    ]
