"""The clouds of a frame under every defence, as a detector sees them; of frames that are evenly spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.evaluate.detection.comparison import CloudResult, under
from advpipe.stages.evaluate.detection.scoring import CachedDetector, Truth, match


@dataclass(frozen=True)
class DefenceRun:
    """Defences by their texts, as `parse_defences` reads them; seed: of what they draw."""

    texts: tuple[str, ...]
    seed: int

    def results(
        self, detector: CachedDetector, truth: Truth, index: int, clouds: Mapping[str, Cloud]
    ) -> dict[str, CloudResult]:
        """Each cloud of frame `index` under every defence, by `under`; a defence draws the same for each.

        clouds: by condition.
        """
        results = {}
        for name, defence in parse_defences(self.texts).items():
            for condition, cloud in clouds.items():
                rng = named_generator(self.seed, "evaluate", "defence", name, index)
                defended = defence(cloud, rng)
                found = detector.detect(defended.cloud, defended.placement)
                results[under(condition, name)] = CloudResult(
                    found,
                    match(truth, found, detector.classes),
                    count_points(xyz(cloud), found.boxes),
                    len(defended.cloud),
                )
        return results


def evenly_spread(frames: Sequence[int], most: int) -> frozenset[int]:
    """At most so many of these frames: the middles of as many equal parts.

    >>> sorted(evenly_spread(range(0, 100, 10), 3))
    [10, 50, 80]
    """
    count = min(most, len(frames))
    middles = (np.arange(count) + 0.5) * (len(frames) / max(count, 1))
    return frozenset(frames[int(middle)] for middle in middles)
