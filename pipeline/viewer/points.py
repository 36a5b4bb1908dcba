"""The points of a scene, ordered by what an attack did to them, and in few bytes."""

from __future__ import annotations

import base64
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference

Float32 = npt.NDArray[np.float32]

REACH_M = 300.0
"""Points that are farther away are left out: a step of 16 bits stays below a centimetre."""

BYTES_PER_POINT, BYTES_PER_WAY = 7, 6
_STEPS = 32767


@dataclass(frozen=True)
class ScenePoints:
    """P points: those that were kept, moved, removed and added, in this order.

    places: (P, 3) in metres; of moved points in the clean cloud. intensity: (P,) in [0, 1].
    way: (K, 3), how far the K moved points go, zero for one that only reflects otherwise.
    counts: how many are kept, moved, removed and added here; total: in the clouds.
    """

    places: Float32
    intensity: Float32
    way: Float32
    counts: tuple[int, ...]
    total: tuple[int, ...]

    @classmethod
    def of(cls, clean: Cloud, attacked: Cloud | None, change: CloudDifference) -> ScenePoints:
        """All points that are finite, and near enough, of a clean cloud and what an attack made of it."""
        after = clean if attacked is None else attacked
        moved = np.union1d(change.moved, change.intensity_changed).astype(np.int64)
        kept = np.setdiff1d(np.arange(len(clean)), np.concatenate([moved, change.removed]))
        order = (clean[kept], clean[moved], clean[change.removed], after[change.added])
        shown = [_is_near(cloud) for cloud in order]
        ends = xyz(after[moved]) if len(moved) else np.zeros((0, 3), np.float32)
        shown[1] &= _is_near(after[moved]) if len(moved) else shown[1]
        clouds = [cloud[near] for cloud, near in zip(order, shown, strict=True)]
        points = np.concatenate(clouds)
        return cls(
            xyz(points),
            _shade(points["intensity"]),
            (ends - xyz(order[1]))[shown[1]],
            _four(clouds),
            _four(order),
        )

    def thinned(self, limit_bytes: int) -> ScenePoints:
        """As many of them as fit, evenly chosen, the touched ones first."""
        kept, moved, removed, added = self.counts
        touched_bytes = moved * (BYTES_PER_POINT + BYTES_PER_WAY) + (removed + added) * BYTES_PER_POINT
        share = min(1.0, 0.75 * limit_bytes / max(1, touched_bytes))
        room = max(0, int(limit_bytes - share * touched_bytes) // BYTES_PER_POINT)
        wanted = (min(kept, room), *(int(share * count) for count in (moved, removed, added)))
        starts = np.cumsum([0, kept, moved, removed])
        chosen = [
            start + _spread(count, most)
            for start, count, most in zip(starts.tolist(), self.counts, wanted, strict=True)
        ]
        rows = np.concatenate(chosen)
        return replace(
            self,
            places=self.places[rows],
            intensity=self.intensity[rows],
            way=self.way[chosen[1] - kept],
            counts=_four(chosen),
        )

    def packed(self) -> dict[str, object]:
        """As it stands in a page: 16-bit steps of places and ways, 8 bits of intensity, base64."""
        xyz_text, unit_m = packed_metres(self.places)
        way_text, way_unit_m = packed_metres(self.way)
        return {
            "counts": self.counts,
            "total": self.total,
            "xyz": xyz_text,
            "unit_m": unit_m,
            "intensity": _base64(np.rint(self.intensity * 255).astype(np.uint8)),
            "offset": way_text,
            "offset_unit_m": way_unit_m,
        }


def packed_metres(places: npt.NDArray[np.floating]) -> tuple[str, float]:
    """Places (K, 3) as base64 of little-endian int16, and the metres of one step."""
    farthest_m = float(np.abs(places).max(initial=0.0))
    unit_m = farthest_m / _STEPS if farthest_m else 1.0
    return _base64(np.rint(places / unit_m).astype("<i2")), unit_m


def _base64(values: npt.NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _is_near(cloud: Cloud) -> npt.NDArray[np.bool_]:
    return np.asarray((np.abs(xyz(cloud)) <= REACH_M).all(axis=1), bool)  # of NaN this is False


def _shade(intensity: Float32) -> Float32:
    """Intensities in [0, 1]; those of another scale are divided by their largest one."""
    finite = np.nan_to_num(intensity, nan=0.0, posinf=0.0, neginf=0.0)
    most = max(1.0, float(finite.max(initial=0.0)))
    return np.asarray(np.clip(finite / most, 0.0, 1.0), np.float32)


def _spread(count: int, wanted: int) -> npt.NDArray[np.int64]:
    """So many of the indices below `count`, evenly."""
    if wanted >= count:
        return np.arange(count)
    return (np.arange(wanted) * count) // max(1, wanted)


def _four(parts: list[npt.NDArray[np.generic]] | tuple[npt.NDArray[np.generic], ...]) -> tuple[int, ...]:
    return tuple(len(part) for part in parts)
