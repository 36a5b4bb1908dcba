"""Mixed pixels at the edges of objects, and the light of retroreflectors beside them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.atmosphere import PULSE_M
from advpipe.pipeline.sensors.lidar.intensity import RETRO_SIGNAL
from advpipe.pipeline.sensors.lidar.sweep import LidarSweep

Float32 = npt.NDArray[np.float32]

LEAST_STEP_M = np.float32(0.2)
"""A smaller step between neighbouring rays is no edge: the noise hides it."""

BLOOMING_DECADES = np.float32(3.0)
"""By how many powers of ten the light of a retroreflector has fallen at `blooming_deg`: 220 times a white
target's then still gives the return of a target of 22 %, about that of asphalt and paving."""


def mix_edges(
    range_m: Float32, channels: int, spacing_rad: float, divergence_rad: float, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """Change, in place, ranges (R,) of rays whose beam lies on two surfaces; returns their indices.

    Between two columns, spaced s, an edge is anywhere. A beam of width b around either ray crosses it with
    probability b / 2s each, and then a share of up to a half lies on the other surface. Two echoes closer
    than the pulse is long merge, and their common range is the mean, weighted by the shares; of farther
    ones the stronger is reported, the ray's own.
    """
    with np.errstate(invalid="ignore"):
        step_m = range_m[channels:] - range_m[:-channels]
        size_m = np.abs(step_m)
        edges = np.flatnonzero((size_m > LEAST_STEP_M) & (size_m < np.float32(PULSE_M)))
    # Where the edge is, in widths of the beam beyond the first ray's centre.
    place = rng.random(len(edges), dtype=np.float32) * np.float32(spacing_rad / divergence_rad)
    beyond = place - np.float32(spacing_rad / divergence_rad) + np.float32(0.5)
    before = np.float32(0.5) - place
    is_first, is_second = before > 0, beyond > np.maximum(before, 0)
    first, second = edges[is_first & ~is_second], edges[is_second] + channels
    mixed_first = range_m[first] + before[is_first & ~is_second] * step_m[first]
    range_m[second] -= beyond[is_second] * step_m[edges[is_second]]
    range_m[first] = mixed_first
    return np.concatenate([first, second])


class Bloom(NamedTuple):
    """Echoes of retroreflectors in B rays beside them: rays (B,), each once; sources (B,), the rays that hit
    the retroreflectors; signal (B,)."""

    rays: npt.NDArray[np.int64]
    sources: npt.NDArray[np.int64]
    signal: Float32


def bloom(sources: npt.NDArray[np.int64], signal: Float32, sweep: LidarSweep, blooming_rad: float) -> Bloom:
    """The rays within `blooming_rad` of those (K,) that hit retroreflectors, with signals (K,).

    The stray light falls by `BLOOMING_DECADES` up to that angle.
    """
    directions, channels, rays = sweep.directions, sweep.channels, len(sweep.rings)
    spacing_rad = 2 * np.pi / sweep.columns
    reach = int(blooming_rad / spacing_rad)
    shift = np.array(
        [column * channels + ring for column in range(-reach, reach + 1) for ring in (-1, 0, 1)], np.int64
    )
    beside = sources[:, None] + shift
    source = np.repeat(sources, len(shift))
    light = np.repeat(signal, len(shift))
    beside = beside.ravel()
    inside = (beside >= 0) & (beside < rays) & (beside != source)
    inside &= np.abs(beside % channels - source % channels) <= 1  # not over a column's end
    beside, source, light = beside[inside], source[inside], light[inside]
    cos = (directions[:, beside] * directions[:, source]).sum(axis=0)
    share = np.sqrt(np.maximum(2 - 2 * cos, 0)) * np.float32(1 / blooming_rad)
    near = share <= 1
    beside, source = beside[near], source[near]
    light = light[near] * np.power(np.float32(10), -BLOOMING_DECADES * share[near])
    order = np.lexsort([source, -light, beside])
    beside, source, light = beside[order], source[order], light[order]
    strongest = np.flatnonzero(np.append(True, beside[1:] != beside[:-1])[: len(beside)])
    return Bloom(beside[strongest], source[strongest], light[strongest])


def is_dazzling(signal: Float32) -> npt.NDArray[np.bool_]:
    """Whether signals (N,) are those of retroreflectors, not much attenuated."""
    dazzling: npt.NDArray[np.bool_] = signal > RETRO_SIGNAL / 10
    return dazzling
