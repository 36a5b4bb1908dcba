"""A comparison, scored: what all of its figures are worked out from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.condition import Arm


@dataclass(frozen=True)
class Scored:
    """The frames of a comparison with the matches on each kind of cloud that all of them have.

    arms: by the cloud's word, `clean` among them. classes: of the detector. in_map: those of the mAP.
    min_score: the working point, from which objects and detections are counted. per_frame: the counts.
    """

    comparison: Comparison
    arms: Mapping[str, Arm]
    classes: tuple[str, ...]
    in_map: tuple[str, ...]
    bootstrap: BlockBootstrap
    min_score: float
    per_frame: tuple[FrameRow, ...]

    def arm(self, word: str) -> Arm:
        """The clouds of a word that is not among `arms`, such as those under a defence."""
        return Arm.of(self.comparison.frames, word, self.classes, self.in_map, self.bootstrap)
