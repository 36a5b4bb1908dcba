"""Gardens: uneven, sloping or raised ground, what encloses it, and what grows there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.parcels import Parcel
from advpipe.stages.simulate.world.raycast.shapes import quads

ROWS_M = (0.0, 0.8, 1.8, 3.2, 5.5, 10.0, 16.0)
"""Distances of the garden's points behind its front; close to the street they are close together."""

COLUMN_M = 2.8
SKIRT_M = 0.3
FLAT_M = 0.01

Profile = Callable[[Float64], Float64]


@dataclass(frozen=True)
class Garden:
    """The ground of a parcel, `depth_m` deep, on the slope of the street. profile: its height above the
    street at distances behind the front. material: of the ground; step: of what retains it in front."""

    parcel: Parcel
    depth_m: float
    profile: Profile
    material: str = "grass"
    step: str = "grass"

    def heights_m(self, along_back_m: Float64) -> Float64:
        """Heights (N,) in the map of points (N, 2): along the front, and behind it."""
        along, back = along_back_m.T
        return self.parcel.street_m(along) + self.profile(back)

    def mesh(self, rng: np.random.Generator) -> Mesh:
        """The surface, with skirts down to the terrain at its rim."""
        back = np.array([*(row for row in ROWS_M if row < self.depth_m - 0.3), self.depth_m])
        half_m = self.parcel.width_m / 2
        along = np.linspace(-half_m, half_m, max(round(2 * half_m / COLUMN_M), 1) + 1)
        grid = np.stack(np.meshgrid(along, back), axis=-1)
        flat = grid.reshape(-1, 2)
        rough = rng.normal(0, 0.035, grid.shape[:2])
        rough[0] = 0.0
        z_m = self.heights_m(flat).reshape(rough.shape) + rough + FLAT_M
        xy_m = self.parcel.places(flat)
        points = np.concatenate([xy_m.reshape(*rough.shape, 2), z_m[..., None]], axis=2)
        cells = np.stack([points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]], axis=2)
        parts = [quads(cells.reshape(-1, 4, 3), self.material)]
        high_m = float(self.profile(back).max())
        if high_m > 0:
            drop_m = high_m + SKIRT_M
            parts += [_skirt(rim, drop_m, self.material) for rim in (points[-1], points[:, 0], points[:, -1])]
            parts.append(_skirt(points[0], drop_m, self.step))
        return merge(parts)


def _skirt(rim_m: Float64, drop_m: float, material: str) -> Mesh:
    below = rim_m - (0, 0, drop_m)
    return quads(np.stack([rim_m[:-1], rim_m[1:], below[1:], below[:-1]], axis=1), material)


def draw_garden(parcel: Parcel, depth_m: float, slopes: float, rng: np.random.Generator) -> Garden:
    """Level ground, or with a probability of `slopes` a bank, a gentle rise or a terrace behind a step."""
    material = "soil" if rng.random() < 0.12 else "grass"
    if rng.random() >= slopes:
        return Garden(parcel, depth_m, lambda back: np.zeros(len(back)), material)
    kind, high_m = int(rng.integers(3)), rng.uniform(0.4, 1.3)
    if kind == 0:
        grade = rng.uniform(0.3, 0.6)
        return Garden(
            parcel, depth_m, lambda back: np.minimum(np.maximum(back - 0.7, 0) * grade, high_m), material
        )
    if kind == 1:
        grade = rng.uniform(0.05, 0.12)
        return Garden(parcel, depth_m, lambda back: np.minimum(back * grade, high_m), material)
    step = ("garden_wall", "masonry", "kerbstone")[int(rng.integers(3))]
    return Garden(parcel, depth_m, lambda back: np.full(len(back), min(high_m, 0.9)), material, step)


def stretches(width_m: float, gaps_m: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """What is left of a front, from -width / 2 to width / 2, between gaps (middle, width); none is short."""
    edges = [-width_m / 2]
    for middle, wide in sorted(gaps_m):
        edges += [middle - wide / 2, middle + wide / 2]
    edges.append(width_m / 2)
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in pairs if b - a > 0.6]


def inclined(garden: Garden, from_m: Float64, to_m: Float64) -> tuple[Float64, float]:
    """The pose (4, 4) of a straight enclosure between two places (along, back), and its length."""
    ends = np.stack([from_m, to_m])
    a, b = garden.parcel.places(ends)
    low, high = garden.heights_m(ends)
    long_m = float(np.linalg.norm(b - a))
    yaw_rad = float(np.arctan2(*(b - a)[::-1]))
    pitch_rad = -float(np.arctan2(high - low, long_m))
    return se3_from_yaw((*(a + b) / 2, (low + high) / 2), yaw_rad, pitch_rad), long_m
