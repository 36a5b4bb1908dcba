"""What an attack check says of the clouds of one frame, in counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import Suspicion

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CheckedCloud:
    """score: of the cloud. points, flagged: of the cloud; both 0 for a check that judges no points. touched,
    touched_flagged: of the points that an attack moved or added. detections: (K,) scores of the judged
    detections, of an attacked cloud only of those that the clean one lacks; None if none are judged. fake:
    how many of these the check takes for spoofed by limits of its own; None if it has none."""

    score: float
    points: int = 0
    flagged: int = 0
    touched: int = 0
    touched_flagged: int = 0
    detections: Float64 | None = None
    fake: int | None = None

    @classmethod
    def of(cls, found: Suspicion, touched: Int64, shown: Bool) -> CheckedCloud:
        """touched: indices of points that an attack changed. shown: (K,) which detections count."""
        detections = None if found.detections is None else found.detections[shown]
        fake = None if found.fake is None else int(found.fake[shown].sum())
        if found.points is None:
            return cls(found.score, detections=detections, fake=fake)
        return cls(
            found.score,
            len(found.points),
            int(found.points.sum()),
            len(touched),
            int(found.points[touched].sum()),
            detections,
            fake,
        )


@dataclass(frozen=True, slots=True)
class CheckedFrame:
    """A check on the clean cloud of a frame and on its adversarial version; None where that is as it was."""

    clean: CheckedCloud
    attacked: CheckedCloud | None
