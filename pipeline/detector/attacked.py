"""The detectors that an attack is made against, by name: one, or several joined by commas as an ensemble."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import detector_sha256, detector_slug, load_detector, member_names


def load_attacked(name: str, device: str = CPU) -> ObjectDetector:
    """The detector of a name, or the ensemble of several joined by commas. Raises UsageError as
    `load_detector` and `member_names` do."""
    from advpipe.pipeline.detector.ensemble import ensemble_of

    members = [load_detector(each, device) for each in member_names(name)]
    return ensemble_of(members) if len(members) > 1 else members[0]


def attacked_sha256(name: str) -> str:
    """The identities of all members, as `detector_sha256` has them, joined by commas."""
    return ",".join(map(detector_sha256, member_names(name)))


def attacked_name(name: str) -> str:
    """The names without folders, joined by commas."""
    return ",".join(Path(each).name for each in member_names(name))


def attacked_slug(name: str) -> str:
    """The names as one folder name."""
    return "+".join(map(detector_slug, member_names(name)))
