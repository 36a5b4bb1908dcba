"""A LiDAR against itself: no more returns are missing anywhere than surfaces of such a brightness lose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.attack_detection.density import QUANTILE
from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import Situation


class LidarDensityCue(Cue):
    """The excess of missing returns in windows of 5 rings and 11 columns, in standard deviations."""

    needs = (EvidenceKind.CLOUDS,)
    meaning = "missing LiDAR returns against what surfaces lose"

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            if scan.sensor is None or (image := scan.image) is None or not len(scan.cloud):
                continue
            excess = scan.sensor.losses.excess(image)
            value = float(np.quantile(excess, QUANTILE))
            column = int(np.argmax(excess.max(axis=0)))
            turn = (column + scan.sensor.geometry.phase) / scan.sensor.geometry.columns
            left_deg = (360 * turn + 180) % 360 - 180
            words = (
                f"more of its returns are missing than surfaces lose ({value:.1f} standard deviations), "
                f"most at {abs(left_deg):.0f}° to the {'left' if left_deg >= 0 else 'right'}"
            )
            yield CueReading(Suspect(scan.name), scan.time_ns, max(value, 0.0), words)
