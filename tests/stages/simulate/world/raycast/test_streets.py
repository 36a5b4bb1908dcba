"""What stands beside streets: where it may, as the scenario asks, and the same for the same seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from advpipe.pipeline.core.seeding import named_generator
from advpipe.stages.simulate.world.raycast.gardens import draw_garden, stretches
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID, SEMANTIC, SEMANTIC_CLASSES
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.occupied import WALKWAY_M, Occupied, walkways
from advpipe.stages.simulate.world.raycast.parcels import Parcel, parcels_along
from advpipe.stages.simulate.world.raycast.scenery import build_scenery
from advpipe.stages.simulate.world.raycast.terrain import FAST_CLEAR_M, HILL_M, STREET_CLEAR_M, Terrain

NOTHING: dict[str, float] = dict.fromkeys(
    (
        "buildings", "rows", "fences", "hedges", "slopes", "wires", "trees_per_km", "bushes_per_km",
        "poles_per_km", "clutter_per_km", "barriers",
    ),
    0.0,
)  # fmt: skip
PERSON_M = 2.0


def scenery(place: Any, seed: int = 1, **keys: float) -> tuple[Mesh, list[shapely.Polygon]]:
    environment = place.scenario.environment.model_copy(update=keys)
    scenario = place.scenario.model_copy(update={"environment": environment})
    roads = place.world.roads
    terrain = Terrain(roads, environment.slopes, named_generator(seed, "terrain"))
    occupied = Occupied(roads, free=walkways(roads))
    return build_scenery(
        scenario, place.network, roads, terrain, occupied, lambda use: named_generator(seed, use)
    )


def points_on(mesh: Mesh) -> np.ndarray:
    """The middles of all triangles and of their sides, and their corners."""
    corners = mesh.vertices_m[mesh.triangles]
    sides = (corners + np.roll(corners, 1, axis=1)) / 2
    return np.concatenate([corners.reshape(-1, 3), sides.reshape(-1, 3), corners.mean(axis=1)])


@pytest.fixture(scope="module")
def town(boulevard: Any) -> tuple[Mesh, list[shapely.Polygon]]:
    return scenery(boulevard, wires=1.0)


def test_nothing_stands_on_roads_and_walkways(boulevard: Any, town: Any) -> None:
    """Up to a person's height; arms of lamps and signals, wires and crowns are above."""
    roads = boulevard.world.roads
    points = points_on(town[0])
    low = points[points[:, 2] < roads.height_at(points[:, :2]) + PERSON_M]
    assert len(low) > 100_000
    assert not shapely.contains_xy(roads.area, low[:, 0], low[:, 1]).any()
    kerbs = shapely.MultiLineString([line[:, :2] for line in roads.kerbs_m])
    walked = kerbs.buffer(4.7).difference(kerbs.buffer(3.1))
    assert not shapely.contains_xy(walked, low[:, 0], low[:, 1]).any()


def test_nothing_hangs_into_the_road(boulevard: Any, town: Any) -> None:
    """Below the height of a truck there are no crowns over lanes, beyond what overhangs by the kerb."""
    roads = boulevard.world.roads
    points = points_on(town[0])
    truck = points[points[:, 2] < roads.height_at(points[:, :2]) + 4.0]
    lanes = roads.area.buffer(-0.8)
    assert shapely.contains_xy(lanes, truck[:, 0], truck[:, 1]).mean() < 1e-4


def test_something_stands_beside_the_road_nearly_everywhere(boulevard: Any) -> None:
    """Within 25 m of most points of the walkways, seen from there, away from the road."""
    starts = []
    for parcels in parcels_along(boulevard.world.roads.kerbs_m, np.random.default_rng(0)):
        starts += [(*parcel.front_m, parcel.yaw_rad - np.pi / 2) for parcel in parcels]
    table = np.array(starts)
    for up_m, least in ((0.5, 0.8), (1.2, 0.75)):
        rays = np.column_stack(
            [table[:, :2], table[:, 2] + up_m, np.cos(table[:, 3]), np.sin(table[:, 3]), 0 * table[:, 3]]
        )
        range_m = boulevard.world._static.cast(rays.astype(np.float32)).range_m
        assert (range_m < 25).mean() > least


def test_zero_means_none(boulevard: Any) -> None:
    mesh, footprints = scenery(boulevard, **NOTHING)
    assert footprints == []
    grown = {"foliage", "conifer", "bark", "tall_grass", "plaster", "fence", "garden_wall", "wood", "wire"}
    assert not {MATERIAL_ID[name] for name in grown} & set(mesh.materials.tolist())


@pytest.mark.parametrize(
    ("key", "value", "material"),
    [
        ("buildings", 1.0, "pane"),
        ("fences", 1.0, "fence"),
        ("hedges", 1.0, "foliage"),
        ("wires", 1.0, "wire"),
        ("trees_per_km", 60.0, "bark"),
        ("bushes_per_km", 60.0, "tall_grass"),
        ("poles_per_km", 60.0, "sign"),
        ("clutter_per_km", 60.0, "bin"),
        ("slopes", 1.0, "garden_wall"),
    ],
)
def test_each_key_brings_its_own(boulevard: Any, key: str, value: float, material: str) -> None:
    mesh, footprints = scenery(boulevard, **{**NOTHING, key: value})
    assert MATERIAL_ID[material] in mesh.materials
    assert bool(footprints) == (key == "buildings")
    semantic = {SEMANTIC_CLASSES[each] for each in np.unique(SEMANTIC[mesh.materials])}
    assert ("building" in semantic) <= (key in ("buildings", "fences", "slopes", "clutter_per_km"))


def test_rows_are_wall_to_wall(boulevard: Any) -> None:
    def gaps(rows: float) -> float:
        _, footprints = scenery(boulevard, **{**NOTHING, "buildings": 1.0, "rows": rows})
        tree = shapely.STRtree(footprints)
        near = [len(tree.query(each.buffer(0.3), predicate="intersects")) > 1 for each in footprints]
        return float(np.mean(near))

    assert gaps(1.0) > gaps(0.0) + 0.2


def test_houses_do_not_overlap_and_stand_behind_the_walkway(boulevard: Any, town: Any) -> None:
    footprints = town[1]
    assert len(footprints) > 100
    pairs = shapely.STRtree(footprints).query(footprints, predicate="intersects").T
    shared = [footprints[a].intersection(footprints[b]).area for a, b in pairs if a < b]
    assert max(shared, default=0) < 2.0
    kerbs = shapely.MultiLineString([line[:, :2] for line in boulevard.world.roads.kerbs_m])
    assert shapely.distance(kerbs, np.array(footprints)).min() > WALKWAY_M[1]


def test_wires_hang_above_trucks(boulevard: Any, town: Any) -> None:
    mesh = town[0]
    points = mesh.vertices_m[np.unique(mesh.triangles[mesh.materials == MATERIAL_ID["wire"]])]
    assert (points[:, 2] - boulevard.world.roads.height_at(points[:, :2])).min() > 5.0


def test_same_seed_same_scenery(boulevard: Any, town: Any) -> None:
    again, other = scenery(boulevard, wires=1.0)[0], scenery(boulevard, seed=2, wires=1.0)[0]
    assert np.array_equal(town[0].vertices_m, again.vertices_m)
    assert np.array_equal(town[0].materials, again.materials)
    assert town[0].vertices_m.shape != other.vertices_m.shape


def test_fast_roads_stay_open(hill: Any) -> None:
    """Beside them stand neither houses nor gardens; at most noise barriers are near."""
    roads = hill.world.roads
    _, footprints = scenery(hill, buildings=1.0, fences=1.0)
    fast = shapely.MultiLineString([line[:, :2] for line in roads.verges_m])
    assert shapely.distance(fast, np.array(footprints)).min() > 3.0
    mesh, _ = scenery(hill, **{**NOTHING, "fences": 1.0})
    panels = np.unique(mesh.triangles[mesh.materials == MATERIAL_ID["noise_barrier"]])
    assert len(panels)
    points = mesh.vertices_m[panels]
    assert not shapely.contains_xy(roads.area, points[:, 0], points[:, 1]).any()


def test_hills_begin_away_from_roads(boulevard: Any, hill: Any) -> None:
    rng = np.random.default_rng(0)
    for place in (boulevard, hill):
        roads = place.world.roads
        hilly, level = Terrain(roads, 1.0, np.random.default_rng(3)), Terrain(roads, 0.0, rng)
        lanes = np.concatenate([sample.samples_m[:, :2] for sample in roads.levels])
        fast = np.concatenate([sample.fast for sample in roads.levels])
        xy_m = lanes[rng.integers(len(lanes), size=4000)] + rng.uniform(-90, 90, (4000, 2))
        rise = hilly.at(xy_m) - level.at(xy_m)
        away_m = np.linalg.norm(xy_m[:, None] - lanes[None, ::4], axis=2)
        clear = (away_m < np.where(fast, FAST_CLEAR_M, STREET_CLEAR_M)[::4]).any(axis=1)
        assert np.all(rise[clear] == 0)
        assert HILL_M[0] - 1e-9 <= rise.min() < 0 < rise.max() <= HILL_M[1] + 1e-9


def test_gardens_rise_from_the_level_of_the_street() -> None:
    parcel = Parcel(np.array([10.0, 20.0, 1.5]), 0.7, 12.0, 0.04)
    for seed in range(20):
        garden = draw_garden(parcel, 14.0, 1.0, np.random.default_rng(seed))
        mesh = garden.mesh(np.random.default_rng(seed))
        local = (mesh.vertices_m[:, :2] - parcel.front_m[:2]) @ [
            [np.cos(0.7), np.sin(0.7)],
            [np.sin(0.7), -np.cos(0.7)],
        ]
        assert np.abs(local[:, 0]).max() <= 6.0 + 1e-6
        assert local[:, 1].min() >= -1e-6
        assert local[:, 1].max() <= 14.0 + 1e-6
        above_m = mesh.vertices_m[:, 2] - 1.5
        assert above_m.max() < 0.04 * 6 + 1.3 + 0.2
        assert garden.profile(np.linspace(0, 14, 50)).max() > 0.3


def test_gaps_of_a_front() -> None:
    assert stretches(10.0, []) == [(-5.0, 5.0)]
    assert stretches(10.0, [(2.0, 1.0), (-3.0, 3.0)]) == [(-1.5, 1.5), (2.5, 5.0)]
