"""A scored comparison, from which all its metrics are computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches


@dataclass(frozen=True)
class Scored:
    """The frames of a comparison with the matches on each kind of cloud that all of them have.

    by_condition: `clean` among them. classes: of the detector. in_map: those of the mAP.
    min_score: the working point, from which objects and detections are counted. per_frame: the counts.
    """

    comparison: Comparison
    by_condition: Mapping[str, ConditionMatches]
    classes: tuple[str, ...]
    in_map: tuple[str, ...]
    bootstrap: BlockBootstrap
    min_score: float
    per_frame: tuple[FrameRow, ...]
