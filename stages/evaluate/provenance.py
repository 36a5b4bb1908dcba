"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.versions import installed
from advpipe.stages.evaluate.detection.comparison import Comparison, bag_name
from advpipe.stages.evaluate.detection.figures import Row


def describe_bags(clean: Path, clean_sha256: str, comparisons: Sequence[Comparison]) -> Row:
    """The bags, their checksums, and which frames of them were scored, counted in the clean bag."""
    scenario = BagReader(clean).provenance.get("scenario_name")
    return {
        "advpipe": installed("advpipe"),
        "clean": {"bag": bag_name(clean), "sha256": clean_sha256, "scenario": scenario},
        "compared": [
            {
                "bag": each.name,
                "sha256": parent_sha256(each.bag) if each.bag else None,
                "provenance": {key: value for key, value in each.provenance.items() if key != "scenario"},
                "frames": [frame.index for frame in each.frames],
            }
            for each in comparisons
        ],
    }


def describe_detector(name: str, detector: Detector, sha256: str) -> Row:
    """The detector by name, checksum (see `detector_sha256`), classes and range."""
    return {
        "name": Path(name).name,
        "sha256": sha256,
        "classes": list(detector.classes),
        "range_m": vars(detector.range_m),
    }


def transfer_remark(comparison: Comparison, sha256: str) -> list[str]:
    """A remark if the attack was made against another detector than the one that is scored."""
    attacked = comparison.provenance.get("detector_sha256")
    if not attacked or not sha256 or attacked == sha256:
        return []
    return ["The attack was made against another detector: this is a transfer attack."]
