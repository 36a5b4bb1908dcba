"""The world against Open3D's own list of all intersections of every ray with one merged mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.geometry.transforms import transform_points
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.body_meshes import body_mesh
from advpipe.stages.simulate.world.raycast.materials import TRANSMITTANCE
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.scene import MAX_PANES, SPECULAR_COS
from advpipe.stages.simulate.world.raycast.windows import SortedRays
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

COUNT = 40


def first_returns(mesh: Mesh, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range and light left (R,) of the first intersection that is no pane passed at a slant."""
    scene = o3d.t.geometry.RaycastingScene()
    vertices = mesh.vertices_m.astype(np.float32)
    scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    listed = {key: value.numpy() for key, value in scene.list_intersections(o3d.core.Tensor(rays)).items()}
    a, b, c = (vertices[mesh.triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    range_m, light = np.full(len(rays), np.inf), np.ones(len(rays))
    order = np.lexsort([listed["t_hit"], listed["ray_ids"]])
    panes = np.zeros(len(rays), np.int64)
    done = np.zeros(len(rays), np.bool_)
    for ray, t, triangle in zip(
        *(listed[key][order] for key in ("ray_ids", "t_hit", "primitive_ids")), strict=True
    ):
        if done[ray]:
            continue
        glass = TRANSMITTANCE[mesh.materials[triangle]]
        if glass and abs(normals[triangle] @ rays[ray, 3:]) < SPECULAR_COS:
            light[ray] *= glass
            panes[ray] += 1
            done[ray] = panes[ray] > MAX_PANES
        else:
            range_m[ray], done[ray] = t, True
    light[np.isinf(range_m)] = 1.0
    return range_m, light


@pytest.fixture(scope="module")
def cast(boulevard: Any, sweep: Any, users: Any, middle_m: np.ndarray) -> Any:
    everyone = users(boulevard, COUNT)
    rays = sweep(middle_m + (0, 0, 1.8), 2160)
    return rays, everyone, boulevard.world.cast(rays, everyone)


def test_hits_of_each_road_user_match_open3d(boulevard: Any, cast: Any) -> None:
    """Range, light left, and which rays: for every body, in a pose of its own."""
    rays, everyone, _ = cast
    candidates = boulevard.world._bodies.candidate_hits(rays, everyone)
    for index, user in enumerate(everyone):
        expected, _ = first_returns(body_mesh(user.variant).transformed(user.map_SE3_base), rays)
        of = candidates.users == index
        found = np.full(len(rays), np.inf)
        found[candidates.rays[of]] = candidates.returns.range_m[of]
        # A ray along an edge may go either way.
        same = np.isclose(found, expected, atol=3e-3) | (np.isinf(found) & np.isinf(expected))
        assert (~same).sum() <= max(2, 0.01 * np.isfinite(expected).sum()), user.variant.name


def test_the_nearest_return_is_kept_and_occlusion_matches(boulevard: Any, cast: Any) -> None:
    rays, everyone, hits = cast
    static = boulevard.world._static.cast(rays)
    parked = boulevard.world.parked
    alone = np.stack(
        [
            first_returns(body_mesh(user.variant).transformed(user.map_SE3_base), rays)[0]
            for user in (*everyone, *parked)
        ]
    )
    nearest = np.minimum(static.range_m, alone.min(axis=0))
    finite = np.isfinite(nearest)
    assert (
        np.array_equal(np.isfinite(hits.range_m), finite)
        or (np.isfinite(hits.range_m) != finite).mean() < 1e-3
    )
    both = finite & np.isfinite(hits.range_m)
    assert np.mean(np.abs(hits.range_m[both] - nearest[both]) > 3e-3) < 1e-3
    ids = np.array([*range(len(everyone)), *(-2 - k for k in range(len(parked)))])
    owner = np.where(alone.min(axis=0) < static.range_m, ids[alone.argmin(axis=0)], -1)
    assert np.mean(owner[both] != hits.objects[both]) < 1e-3
    would = np.isfinite(alone).sum(axis=1)
    sees = np.array([((owner == index) & finite).sum() for index in ids])
    expected = np.where(would > 0, 1 - sees / np.maximum(would, 1), 0.0)
    assert hits.occlusion.shape == (len(everyone) + len(parked),)
    some = would >= 50
    assert some.sum() > 20
    assert np.abs(hits.occlusion - expected)[some].max() < 0.02
    assert np.ptp(expected[some]) > 0.5  # some stand free, some hide


def test_a_far_parked_car_is_left_out_beyond_the_range(boulevard: Any, cast: Any) -> None:
    rays, _, hits = cast
    near = boulevard.world.cast(rays, [], range_m=20.0)
    away_m = [np.linalg.norm(car.position_m - rays[0, :3]) for car in boulevard.world.parked]
    seen = {-2 - int(index) for index in np.unique(near.objects) if index < -1}
    assert seen
    assert max(away_m[k] for k in seen) < 31.0
    assert {-2 - int(index) for index in np.unique(hits.objects) if index < -1} > seen


@pytest.mark.parametrize("middle_rad", [0.0, 2.0, 3.1], ids=["ahead", "aside", "behind"])
@pytest.mark.parametrize("half_rad", [np.pi, 1.0, 0.15], ids=["all", "wide", "narrow"])
def test_angular_windows_contain_every_ray_that_hits_a_box(
    sweep: Any, half_rad: float, middle_rad: float
) -> None:
    """Against slabs: also boxes around the sensor, beside it, tilted ones, and across the circle's end."""
    rng = np.random.default_rng(0)
    rays = sweep(np.zeros(3))
    turn = np.arctan2(rays[:, 4], rays[:, 3]) - middle_rad
    rays = rays[np.abs((turn + np.pi) % (2 * np.pi) - np.pi) <= half_rad]
    rays[:, :3] += np.linspace(0, 1, len(rays))[:, None].astype(np.float32) * np.array([3, 1, 0], np.float32)
    poses, halves = [], []
    for _ in range(60):
        axis_angle = rng.normal(0, [0.1, 0.1, 2.0])
        rotation = o3d.geometry.get_rotation_matrix_from_xyz(axis_angle)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, rng.normal(0, [15, 15, 1.0])
        poses.append(pose)
        halves.append(rng.uniform(0.2, [8, 1.5, 2]))
    pairs = SortedRays(rays[:, :3].T, rays[:, 3:].T).pairs(np.array(poses), np.array(halves))
    found = set(zip(*(column.tolist() for column in pairs), strict=True))
    met = 0
    for index, (pose, half) in enumerate(zip(poses, halves, strict=True)):
        origin = transform_points(np.linalg.inv(pose), rays[:, :3])
        direction = rays[:, 3:] @ pose[:3, :3]
        with np.errstate(divide="ignore"):
            slabs = np.stack([(side * half - origin) / direction for side in (-1, 1)])
        enter, leave = slabs.min(axis=0).max(axis=1), slabs.max(axis=0).min(axis=1)
        rays_in = np.flatnonzero((enter <= leave) & (leave > 0))
        met += len(rays_in)
        assert {(ray, index) for ray in rays_in.tolist()} <= found
    assert met > 10_000 * half_rad / np.pi
    assert len(found) < 0.5 * len(rays) * len(poses)


def test_same_seed_same_world(boulevard: Any, cast: Any) -> None:
    rays, everyone, hits = cast
    again = RaycastWorld(boulevard.scenario, boulevard.network, boulevard.variants).cast(rays, everyone)
    for name in ("range_m", "cos_incidence", "materials", "transmission", "objects", "occlusion"):
        assert np.array_equal(getattr(hits, name), getattr(again, name)), name
    other = boulevard.scenario.model_copy(
        update={"simulation": boulevard.scenario.simulation.model_copy(update={"seed": 77})}
    )
    elsewhere = RaycastWorld(other, boulevard.network, boulevard.variants).cast(rays, everyone)
    assert not np.array_equal(hits.range_m, elsewhere.range_m)


def test_points_on_road_users_are_inside_their_boxes(cast: Any) -> None:
    """But for mirrors: at least 98 % of what a box, grown by them, holds."""
    rays, everyone, hits = cast
    inside = total = 0
    for index, user in enumerate(everyone):
        mine = hits.objects == index
        points = rays[mine, :3] + hits.range_m[mine, None] * rays[mine, 3:]
        local = transform_points(np.linalg.inv(user.map_SE3_base), points)
        half = np.array([user.variant.length_m, user.variant.width_m]) / 2 + 2e-3
        ok = (np.abs(local[:, :2]) <= half).all(axis=1) & (local[:, 2] > -2e-3)
        inside, total = inside + ok.sum(), total + mine.sum()
    assert total > 2000
    assert inside > 0.98 * total


def test_the_scene_contains_all_kinds_of_city_objects(
    boulevard: Any, sweep: Callable[..., np.ndarray]
) -> None:
    """Seen from many places along the streets."""
    from advpipe.stages.simulate.world.raycast.materials import SEMANTIC, SEMANTIC_CLASSES

    seen: set[str] = set()
    for lane in [edge.lanes[0] for edge in boulevard.network.drivable][::3]:
        hits = boulevard.world.cast(sweep(lane.centre_m.mean(axis=0) + (0, 0, 1.8), 360), [])
        seen |= {SEMANTIC_CLASSES[i] for i in SEMANTIC[hits.materials[hits.range_m < 100]]}
    assert seen >= set(SEMANTIC_CLASSES) - {"other"}
    assert isinstance(boulevard.world.parked[0], RoadUser)
    assert replace(boulevard.world.parked[0], id="x").id == "x"
