"""What stands on the parcels beside a street: houses with gardens, rows of houses, blocks, open land."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from advpipe.pipeline.scenario.environment import Environment
from advpipe.stages.simulate.world.raycast.buildings import draw_style, garage, house, shed
from advpipe.stages.simulate.world.raycast.enclosures import THICK_M, enclosure
from advpipe.stages.simulate.world.raycast.facades import STEPS_M
from advpipe.stages.simulate.world.raycast.gardens import Garden, draw_garden, inclined, stretches
from advpipe.stages.simulate.world.raycast.leaves import hedge
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.occupied import footprint
from advpipe.stages.simulate.world.raycast.parcels import Parcel
from advpipe.stages.simulate.world.raycast.site import Site
from advpipe.stages.simulate.world.raycast.templates import Plants

DEPTHS_M = (22.0, 14.0, 8.0, 4.0)
"""Depth of a parcel: the largest one that is free."""

FRONT_M = 0.3
"""The middle of what encloses a parcel, behind its front."""

PIECE_M = 9.0
UNEVEN_M = 0.6
"""No garden is laid out where the land leaves the plane of the street by more."""

KINDS = ("picket", "boards", "mesh", "railing", "wall", "high wall")
KIND_SHARES = (0.2, 0.13, 0.17, 0.15, 0.25, 0.1)
RURAL = 0.3
"""Share of the houses and enclosures of a town that stand beside a road out of town."""


@dataclass(frozen=True)
class Street:
    """What the parcels of one side of a street have in common.

    rows: whether its houses stand in rows. setback_m: of their facades behind the front. storeys: most of
    them. urban: share of blocks without gardens. built, fenced, hedged: shares of the parcels.
    """

    rows: bool
    setback_m: float
    storeys: int
    urban: float
    built: float
    fenced: float
    hedged: float


def draw_street(environment: Environment, rural: bool, rng: np.random.Generator) -> Street:
    """A street of a town, or a road out of town."""
    share = RURAL if rural else 1.0
    urban = float(rng.choice((0.0, 0.25, 0.8), p=(0.5, 0.3, 0.2)))
    return Street(
        rows=bool(rng.random() < environment.rows),
        setback_m=rng.uniform(1.2, 5.5),
        storeys=int(rng.integers(1, 4)),
        urban=0.0 if rural else urban,
        built=environment.buildings * share,
        fenced=environment.fences * share,
        hedged=environment.hedges * share,
    )


class Estates:
    """Fills the parcels of streets."""

    def __init__(
        self, site: Site, environment: Environment, plants: Plants, rng: np.random.Generator
    ) -> None:
        self._site, self._environment, self._plants, self._rng = site, environment, plants, rng

    def fill(self, parcels: list[Parcel], rural: bool) -> None:
        """The parcels of one side of a street."""
        street = draw_street(self._environment, rural, self._rng)
        for parcel in parcels:
            self._fill(parcel, street)

    def _fill(self, parcel: Parcel, street: Street) -> None:
        rng = self._rng
        depth_m = next((depth for depth in DEPTHS_M if self._take(parcel, depth)), 0.0)
        built = bool(rng.random() < street.built) and depth_m >= 8.0
        urban = built and bool(rng.random() < street.urban)
        slopes = 0.0 if urban or not depth_m else self._environment.slopes
        garden = draw_garden(parcel, max(depth_m, 0.5), slopes, rng)
        if depth_m and not urban:
            self._site.meshes.append(garden.mesh(rng))
        gaps: list[tuple[float, float]] = []
        if urban:
            self._block(garden, street)
        elif built and street.rows:
            gaps = self._row(garden, street)
        elif built:
            gaps = self._detached(garden, street)
        if not urban:
            self._enclose(garden, street, gaps)
            self._plant(garden)

    def _take(self, parcel: Parcel, depth_m: float) -> bool:
        """Whether the parcel may be that deep: free, and level with its street as far as that."""
        half_m = parcel.width_m / 2
        corners = np.array([[along, back] for along in (-half_m, half_m) for back in (0.5, depth_m)])
        ground_m = self._site.terrain.at(parcel.places(corners))
        if np.abs(ground_m - parcel.street_m(corners[:, 0])).max() > UNEVEN_M:
            return False
        return self._site.land.take(parcel.at(0, depth_m / 2 + 0.02), parcel.width_m - 0.1, depth_m - 0.1)

    def _house(
        self, garden: Garden, along_m: float, setback_m: float, size_m: tuple[float, float], storeys: int,
        joined: bool,
    ) -> bool:  # fmt: skip
        """A house whose facade is `setback_m` behind the front, if there is room for it and its steps."""
        length_m, depth_m = size_m
        site, parcel = self._site, garden.parcel
        taken = parcel.at(along_m, setback_m + depth_m / 2 - STEPS_M / 2)
        if not site.occupied.take(taken, length_m - 0.1, depth_m + STEPS_M):
            return False
        pose = parcel.at(along_m, setback_m + depth_m / 2, _height(garden, along_m, setback_m + 0.5))
        style = draw_style(storeys, self._rng)
        site.meshes.append(house(length_m, depth_m, style, self._rng, joined=joined).transformed(pose))
        site.footprints.append(footprint(pose, length_m, depth_m))
        return True

    def _block(self, garden: Garden, street: Street) -> None:
        """A block along the walkway, of up to five storeys."""
        depth_m = min(self._rng.uniform(9.0, 13.0), garden.depth_m - 1.5)
        storeys = street.storeys + int(self._rng.integers(1, 3))
        size = (garden.parcel.width_m - 0.05, depth_m)
        self._house(garden, 0.0, self._rng.uniform(1.0, 1.5), size, storeys, bool(self._rng.random() < 0.6))

    def _row(self, garden: Garden, street: Street) -> list[tuple[float, float]]:
        """Houses wall to wall; the gates of their gardens as (middle, width)."""
        width_m = garden.parcel.width_m
        count = max(round(width_m / self._rng.uniform(5.5, 8.0)), 1)
        depth_m = min(self._rng.uniform(7.5, 10.0), garden.depth_m - 1.0)
        setback_m = min(street.setback_m, garden.depth_m - depth_m + 0.5)
        gates = []
        for middle in (np.arange(count) + 0.5) * width_m / count - width_m / 2:
            storeys = max(street.storeys + int(self._rng.random() < 0.15), 1)
            size = (width_m / count, depth_m)
            if self._house(garden, float(middle), max(setback_m, 1.2), size, storeys, joined=True):
                gates.append((float(middle), 1.1))
        return gates

    def _detached(self, garden: Garden, street: Street) -> list[tuple[float, float]]:
        """A house in its garden, often with a garage or a shed; its gate and drive as (middle, width)."""
        rng, width_m = self._rng, garden.parcel.width_m
        aside_m = 4.2 if width_m > 13 and rng.random() < 0.6 else rng.uniform(1.0, 2.0)
        length_m = max(min(width_m - aside_m - 0.8, 15.0), 5.0)
        depth_m = min(rng.uniform(7.5, 11.0), garden.depth_m - 1.5)
        setback_m = max(min(street.setback_m + rng.uniform(-0.8, 2.5), garden.depth_m - depth_m), 1.2)
        side = float(rng.choice((-1, 1)))
        along_m = -side * (width_m - length_m - 0.8) / 2
        self._house(garden, along_m, setback_m, (length_m, depth_m), street.storeys, joined=False)
        gaps = [(along_m + rng.uniform(-0.3, 0.3) * length_m, 1.1)]
        if aside_m > 4:
            aside = side * (width_m / 2 - 2.0)
            self._put(garden, garage(rng), aside, setback_m + rng.uniform(3.5, 6.0), (3.3, 6.2))
            gaps.append((aside, 3.0))
        elif rng.random() < 0.4:
            self._put(garden, shed(rng), rng.uniform(-0.4, 0.4) * width_m, garden.depth_m - 2.0, (2.4, 2.9))
        return [gap for gap in gaps if abs(gap[0]) + gap[1] / 2 < width_m / 2 - 0.3]

    def _put(
        self, garden: Garden, mesh: Mesh, along_m: float, back_m: float, size_m: tuple[float, float]
    ) -> None:
        pose = garden.parcel.at(along_m, back_m, _height(garden, along_m, back_m))
        self._site.place(mesh, pose, *size_m)

    def _enclose(self, garden: Garden, street: Street, gaps: list[tuple[float, float]]) -> None:
        """A fence, a wall or a hedge in front, on one side and behind."""
        draw = self._rng.random()
        kind = "hedge" if draw < street.hedged else KINDS[int(self._rng.choice(len(KINDS), p=KIND_SHARES))]
        half_m, back_m = garden.parcel.width_m / 2, garden.depth_m - 0.3
        if draw < street.hedged + street.fenced:
            gaps = [gap for gap in gaps if gap[1] < 2 * half_m - 1.5]
            for left, right in stretches(2 * half_m, gaps):
                self._stretch(garden, kind, (left + 0.02, FRONT_M), (right - 0.02, FRONT_M))
        if garden.depth_m < 4.0:
            return
        for a, b, chance in (
            ((half_m - 0.3, FRONT_M + 0.6), (half_m - 0.3, back_m - 0.6), 0.6),
            ((-half_m, back_m), (half_m, back_m), 0.8),
        ):
            draw = self._rng.random() / chance
            if draw < street.hedged + street.fenced:
                kind = (
                    "hedge"
                    if draw < street.hedged
                    else ("mesh", "boards", "wall")[int(self._rng.integers(3))]
                )
                self._stretch(garden, kind, a, b)

    def _stretch(self, garden: Garden, kind: str, a: tuple[float, float], b: tuple[float, float]) -> None:
        """One kind of enclosure between two places (along, back), in pieces that follow the ground."""
        rng, site = self._rng, self._site
        count = max(int(np.ceil(np.hypot(b[0] - a[0], b[1] - a[1]) / PIECE_M)), 1)
        ends = np.linspace(a, b, count + 1)
        high_m, thick_m = rng.uniform(0.9, 2.0), rng.uniform(0.6, 0.9)
        for start, end in pairwise(ends):
            pose, long_m = inclined(garden, start, end)
            if not site.occupied.take(pose, long_m - 0.1, thick_m if kind == "hedge" else THICK_M):
                continue
            grown = kind == "hedge"
            mesh = hedge(long_m, 0.9 * thick_m, high_m, rng) if grown else enclosure(kind, long_m, rng)
            site.meshes.append(mesh.transformed(pose))

    def _plant(self, garden: Garden) -> None:
        """Trees, bushes and tufts of grass."""
        rng, width_m = self._rng, garden.parcel.width_m
        trees, bushes = self._environment.trees_per_km, self._environment.bushes_per_km
        # How many per kilometre, which, the side of the square that it takes, and the least distance
        # behind the front, so that no leaf reaches over the walkway.
        for per_km, draw, size_m, nearest_m in (
            (0.5 * trees, self._plants.tree, 1.6, 2.6),
            (0.7 * bushes, self._plants.bush, 1.5, 1.4),
            (1.3 * bushes, self._plants.tall_grass, 0.5, 0.5),
        ):
            deep_m = garden.depth_m - nearest_m
            for _ in range(int(rng.poisson(per_km * width_m / 1000)) if deep_m > 0.5 else 0):
                back_m = nearest_m + deep_m * float(rng.random()) ** 1.6
                along_m = rng.uniform(-0.5, 0.5) * (width_m - size_m)
                self._put(garden, draw(rng), along_m, back_m, (size_m, size_m))


def _height(garden: Garden, along_m: float, back_m: float) -> float:
    return float(garden.heights_m(np.array([[along_m, back_m]]))[0])
