"""What an attack did to a cloud, from the clean and the adversarial cloud alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud, xyz

Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class CloudDifference:
    """Which points of a clean cloud (N,) and its adversarial version (M,) differ.

    removed: (R,) indices into the clean cloud; added: (A,) indices into the adversarial one.
    moved: (K,) indices that mean the same point in both.
    displacement_m: (K,) float64, between the coordinates as stored.
    intensity_changed: (S,) indices, likewise in both, of points whose intensity is another, moved or not.
    """

    removed: Int64
    added: Int64
    moved: Int64
    displacement_m: npt.NDArray[np.float64]
    intensity_changed: Int64

    @property
    def max_displacement_m(self) -> float:
        """The largest displacement of a point; 0 where no point was moved."""
        return float(self.displacement_m.max(initial=0.0))


def cloud_difference(clean: Cloud, adversarial: Cloud) -> CloudDifference:
    """Compare two clouds of `POINT_DTYPE`.

    If both are of one length and agree in `ring` and `time` point by point, points were moved.
    Otherwise points were removed and added: the difference of the two multisets of whole points.
    """
    if len(clean) == len(adversarial) and all(
        np.array_equal(clean[field], adversarial[field], equal_nan=field == "time")
        for field in ("ring", "time")
    ):
        offset = xyz(adversarial).astype(np.float64) - xyz(clean)
        moved = np.flatnonzero((offset != 0).any(axis=1) & np.isfinite(offset).all(axis=1))
        none = np.zeros(0, dtype=np.int64)
        before, after = clean["intensity"], adversarial["intensity"]
        intensity_changed = np.flatnonzero((before != after) & ~(np.isnan(before) & np.isnan(after)))
        return CloudDifference(none, none, moved, np.linalg.norm(offset[moved], axis=1), intensity_changed)
    removed, added = _multiset_difference(_words(clean), _words(adversarial))
    none = np.zeros(0, dtype=np.int64)
    return CloudDifference(removed, added, none, np.zeros(0), none)


def _words(cloud: Cloud) -> npt.NDArray[np.uint64]:
    """The bytes of each point, padded to whole 64-bit words: (N, 3) uint64."""
    rows = np.zeros((len(cloud), 24), dtype=np.uint8)
    rows[:, : cloud.dtype.itemsize] = np.ascontiguousarray(cloud).view((np.uint8, cloud.dtype.itemsize))
    return rows.view(np.uint64)


def _multiset_difference(a: npt.NDArray[np.uint64], b: npt.NDArray[np.uint64]) -> tuple[Int64, Int64]:
    """Indices of the rows of a that b lacks, and of b that a lacks; of equal rows the last ones."""
    rows = np.concatenate([a, b])
    order = np.lexsort(rows.T)  # stable: within equal rows a comes before b, each in its order
    ordered, is_b = rows[order], order >= len(a)
    new_group = np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1))[: len(rows)]
    group = np.cumsum(new_group) - 1
    n_groups = int(group[-1]) + 1 if len(group) else 0
    count_a = np.bincount(group[~is_b], minlength=n_groups)
    count_b = np.bincount(group[is_b], minlength=n_groups)
    rank = np.arange(len(rows)) - np.flatnonzero(new_group)[group]
    rank = np.where(is_b, rank - count_a[group], rank)  # the how-manieth of its kind on its own side
    left_over = rank >= np.where(is_b, count_a[group], count_b[group])
    return np.sort(order[left_over & ~is_b]), np.sort(order[left_over & is_b] - len(a))
