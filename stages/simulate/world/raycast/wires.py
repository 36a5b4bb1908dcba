"""Overhead wires on poles beside a street."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.roads import KERB_M
from advpipe.stages.simulate.world.raycast.furniture import utility_pole
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.plots import Plot
from advpipe.stages.simulate.world.raycast.shapes import quads
from advpipe.stages.simulate.world.raycast.site import Site

SPAN_M = 36.0
LONGEST_SPAN_M = 60.0
POLE_OFFSET_M = 2.75
ASIDE_M = (-0.65, 0.0, 0.65)
SAG_M = 0.7
THICK_M = 0.03
PIECES = 6


def hang_wires(site: Site, kerbs_m: tuple[Float64, ...], share: float, rng: np.random.Generator) -> None:
    """Poles along a share of the kerbs, and wires from each to the next."""
    for kerb in kerbs_m:
        lengths = np.linalg.norm(np.diff(kerb[:, :2], axis=0), axis=1)
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        if rng.random() >= share or ends[-1] < SPAN_M:
            continue
        height_m = rng.uniform(7.2, 9.0)
        before: Float64 | None = None
        for place_m in np.arange(rng.uniform(3, SPAN_M / 2), ends[-1], SPAN_M):
            pose = _pole_pose(kerb, ends, float(place_m))
            if not site.place(utility_pole(rng, height_m), pose, 0.5, 0.5):
                continue
            tops = np.array([(pose @ (0, y, height_m - 0.36, 1))[:3] for y in ASIDE_M])
            if before is not None and np.linalg.norm(before[1] - tops[1]) < LONGEST_SPAN_M:
                site.meshes.append(_wires(before, tops))
            before = tops


def _pole_pose(kerb_m: Float64, ends_m: Float64, place_m: float) -> Float64:
    """The pose of a pole; on uneven ground it stands on the verge, level with the kerb."""
    index = min(int(np.searchsorted(ends_m, place_m, side="right")) - 1, len(kerb_m) - 2)
    step = kerb_m[index + 1] - kerb_m[index]
    part = (place_m - ends_m[index]) / max(ends_m[index + 1] - ends_m[index], 1e-9)
    plot = Plot(kerb_m[index] + part * step, float(np.arctan2(step[1], step[0])))
    return plot.at(POLE_OFFSET_M, KERB_M)


def _wires(from_m: Float64, to_m: Float64) -> Mesh:
    """Wires (N, 3) to (N, 3) that sag, each a band on its edge."""
    share = np.linspace(0, 1, PIECES + 1)[:, None, None]
    lines = from_m + share * (to_m - from_m) - (0, 0, 1) * (4 * SAG_M * share * (1 - share))
    low, high = lines - (0, 0, THICK_M / 2), lines + (0, 0, THICK_M / 2)
    bands = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=2)
    return merge([quads(bands.reshape(-1, 4, 3), "wire")])
