"""What does not count in training frames, as one file of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.geometry.boxes import no_boxes
from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage


def store_uncounted(frames: Sequence[Uncounted], file: Path) -> None:
    """Write the ignored boxes and the regions of all frames, and where those of each begin."""
    regions = [(*each.coverage.labelled, *each.coverage.ignored) for each in frames]
    every = [region for each in regions for region in each]
    np.savez(
        file,
        boxes=np.concatenate([no_boxes(), *(each.boxes.geometry for each in frames)]),
        frame_boxes=_starts([len(each.boxes) for each in frames]),
        planes=np.concatenate([np.zeros((0, 4)), *(region.planes for region in every)]),
        region_planes=_starts([len(region.planes) for region in every]),
        max_range_m=np.array([region.max_range_m for region in every]),
        frame_regions=_starts([len(each) for each in regions]),
        frame_labelled=np.array([len(each.coverage.labelled) for each in frames]),
    )


@dataclass(frozen=True)
class StoredUncounted:
    """The arrays of `store_uncounted`."""

    arrays: dict[str, npt.NDArray[Any]]

    @classmethod
    def read(cls, file: Path) -> StoredUncounted:
        """Those in a file."""
        with np.load(file) as arrays:
            return cls(dict(arrays))

    def of(self, i: int) -> tuple[npt.NDArray[np.float64], LabelCoverage]:
        """The boxes (I, 7) of frame i that count neither way, and where it is labelled."""
        first, last = self.arrays["frame_boxes"][i : i + 2]
        begin, end = self.arrays["frame_regions"][i : i + 2]
        regions = tuple(map(self._region, range(begin, end)))
        labelled = int(self.arrays["frame_labelled"][i])
        boxes = self.arrays["boxes"][first:last].astype(np.float64)
        return boxes, LabelCoverage(regions[:labelled], regions[labelled:])

    def _region(self, k: int) -> ConvexRegion:
        first, last = self.arrays["region_planes"][k : k + 2]
        return ConvexRegion("", self.arrays["planes"][first:last], float(self.arrays["max_range_m"][k]))


def _starts(lengths: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
