"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.code import CLOUDS
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.detector.registry import detector_sha256
from advpipe.pipeline.results.origin import CleanBag, ComparedBag, DetectorOrigin
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name

SCORING = (*CLOUDS, "pipeline/defences", "pipeline/results", "stages/evaluate/detection")
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


def compared_bags(comparisons: Sequence[Comparison], others: Sequence[Path]) -> tuple[ComparedBag, ...]:
    """The bags beside the clean one, their checksums, and which frames of the clean bag were scored.

    others: bags whose clouds nobody attacked, and of which none were scored.
    """
    unseen = [Comparison(bag, BagReader(bag).provenance, ()) for bag in others]
    return tuple(
        ComparedBag(
            each.name,
            parent_sha256(each.bag) if each.bag else None,
            {key: value for key, value in each.provenance.items() if key != "scenario"},
            tuple(frame.index for frame in each.frames),
        )
        for each in (*comparisons, *unseen)
    )


def clean_bag(clean: Path, clean_sha256: str) -> CleanBag:
    """The clean bag, as its own record has it."""
    return CleanBag(bag_name(clean), clean_sha256, BagReader(clean).provenance.get("scenario_name"))


def detector_origin(name: str, detector: Detector, is_training_map: bool | None = None) -> DetectorOrigin:
    """The detector by name, checksum (see `detector_sha256`), classes and range, and whether it was trained
    on drives on the map of the clean bag; None where nobody can say."""
    return DetectorOrigin(
        name=Path(name).name,
        sha256=detector_sha256(name),
        classes=tuple(detector.classes),
        range_m=vars(detector.range_m),
        is_training_map=is_training_map,
    )


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
