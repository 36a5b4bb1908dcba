"""What cameras see of the world: looks of materials, shadows, panes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.surfaces import HEAD_LAMP, TAIL_LAMP
from advpipe.stages.simulate.bodies import BODIES, draw_variants
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast import materials
from advpipe.stages.simulate.world.raycast.body_look import BodyLook, UserTraits, body_tag
from advpipe.stages.simulate.world.raycast.body_meshes import body_meshes
from advpipe.stages.simulate.world.raycast.enclosures import enclosure
from advpipe.stages.simulate.world.raycast.furniture import traffic_light
from advpipe.stages.simulate.world.raycast.instanced_bodies import InstancedBodies
from advpipe.stages.simulate.world.raycast.mesh import box_mesh, merge, surface
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.sign_faces import OCTAGON, ROUND, SignFaces
from advpipe.stages.simulate.world.raycast.static_look import StaticLook
from advpipe.stages.simulate.world.raycast.textures import TEXTURES, Patch
from advpipe.stages.simulate.world.raycast.view import Viewer, moved_on

VARIANTS = draw_variants(np.random.default_rng(0))
MESHES = body_meshes(VARIANTS, {})
GROUND = surface([(-60, -60, 0), (60, -60, 0), (60, 60, 0), (-60, 60, 0)], [[0, 1, 2], [0, 2, 3]], "asphalt")
NOON = np.array([0.0, 0.6, 0.8], np.float32)


@pytest.fixture(scope="module")
def viewer() -> Viewer:
    wall = box_mesh((0.2, 60.0, 6.0), "masonry").moved(30, 0, 0)
    pane = box_mesh((0.01, 2.0, 2.0), "pane").moved(10, -10, 0)
    static = merge([GROUND, wall, pane])
    look = StaticLook(static, [], np.random.default_rng(0))
    bodies = InstancedBodies(VARIANTS, MESHES)
    return Viewer(Scene(static), look, bodies, BodyLook([MESHES[name] for name in VARIANTS]))


def user(body: str, x_m: float, y_m: float, name: str = "a") -> RoadUser:
    return RoadUser(name, VARIANTS[f"{body}.0"], se3_from_yaw((x_m, y_m, 0.0), 0.0), np.array([10.0, 0, 0]))


def rays_to(targets_m: list[tuple[float, float, float]]) -> np.ndarray:
    origin = np.array([0.0, 0.0, 1.5])
    directions = np.array(targets_m) - origin
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.concatenate([np.tile(origin, (len(directions), 1)), directions], axis=1).astype(np.float32)


def test_every_material_has_a_colour_and_a_known_texture() -> None:
    for name, material in materials._MATERIALS.items():
        assert re.fullmatch("#[0-9a-f]{6}", material.colour), name
        assert material.texture in TEXTURES, name
        assert 0 <= material.specular < 1, name
    assert materials.COLOUR.shape == (len(materials.MATERIALS), 3)
    white = materials.COLOUR[materials.MATERIAL_ID["paint_white"]]
    assert white == pytest.approx([0.84, 0.86, 0.86], abs=0.02)  # of #eceeee, by the formula of sRGB


@pytest.mark.parametrize("name", list(TEXTURES))
def test_textures_keep_the_mean_and_fade_into_it(name: str) -> None:
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform(-80, 80, (3, 20_000)).astype(np.float32)
    near = TEXTURES[name](Patch(x, y, z, np.full(20_000, 0.002, np.float32)))
    far = TEXTURES[name](Patch(x, y, z, np.full(20_000, 2.0, np.float32)))
    assert near.mean() == pytest.approx(1, abs=0.15)
    assert near.min() >= 0
    assert far.std() <= near.std() + 1e-6


def test_the_nearest_of_ground_wall_and_body_is_seen(viewer: Viewer) -> None:
    rays = rays_to([(5, 0, 0), (30, 5, 2.0), (12, 0, 0.9), (0, 0, 50)])
    seen = viewer.surfaces(rays, [user("van", 14.0, 0.0)], 0.002)
    order = np.argsort(seen.rays)
    assert seen.rays[order].tolist() == [0, 1, 2]  # the last one meets the sky
    assert seen.tags[order].tolist() == [TAG["Roads"], TAG["Building"], TAG["Truck"]]
    assert seen.objects[order].tolist() == [-1, -1, 0]
    assert seen.normals[:, order[0]] == pytest.approx([0, 0, 1])
    assert seen.normals[:, order[1]] == pytest.approx([-1, 0, 0])  # towards the camera
    assert seen.points_m[:, order[0]] == pytest.approx([5, 0, 0], abs=1e-4)
    red, _, blue = seen.colour[:, order[1]]
    assert red > 1.3 * blue  # bricks


def test_a_pane_lets_the_wall_be_seen(viewer: Viewer) -> None:
    seen = viewer.surfaces(rays_to([(10, -10, 1.0)]), [], 0.002)
    assert seen.tags.tolist() == [TAG["Building"]]
    assert seen.panes.rays.tolist() == [0, 0]
    assert seen.panes.transmittance == pytest.approx([0.55**0.5] * 2)


def test_shadows_fall_away_from_the_sun(viewer: Viewer) -> None:
    """The sun is in the north, 53 degrees high: a van 2.3 m high casts its shadow 1.7 m to the south."""
    van = user("van", 14.0, 0.0)
    half_m = van.variant.width_m / 2
    points = np.array(
        [[14, -half_m - 1.0, 0.01], [14, -half_m - 2.4, 0.01], [14, half_m + 0.5, 0.01], [29, 0, 0.01]]
    )
    shaded = viewer.is_shaded(np.ascontiguousarray(points.T, np.float32), NOON, [van])
    assert shaded.tolist() == [True, False, False, False]
    west = np.array([0.8, 0.0, 0.6], np.float32)  # towards the wall
    assert viewer.is_shaded(np.array([[27.0], [0.0], [0.01]], np.float32), west, []).tolist() == [True]


def test_occluded_bodies_are_known_alone(viewer: Viewer) -> None:
    seen = viewer.surfaces(
        rays_to([(14, 0, 1.0)]), [user("sedan", 25.0, 0.0, "b"), user("van", 14.0, 0.0)], 0.002
    )
    assert seen.objects.tolist() == [1]
    assert sorted(seen.alone_users.tolist()) == [0, 1]


def test_lamps_are_white_ahead_and_red_behind(viewer: Viewer) -> None:
    car = user("sedan", 15.0, 0.0)
    look = BodyLook([MESHES["sedan.0"]])
    ids = np.full(2, materials.MATERIAL_ID["lamp"], np.uint8)
    ends = np.array([[2.3, 0.5, 0.6], [-2.3, 0.5, 0.6]], np.float32)
    colours, lamps = look.colours(ids, UserTraits.of([car]), np.zeros(2, np.int64), ends.T)
    assert lamps.tolist() == [HEAD_LAMP, TAIL_LAMP]
    assert colours[1, 0] > 5 * colours[1, 1]


def test_two_pedestrians_wear_different_clothes() -> None:
    look = BodyLook([MESHES["pedestrian.0"]])
    ids = np.full(8, materials.MATERIAL_ID["cloth"], np.uint8)
    people = [user("pedestrian", 5, 0, f"walker.{k}") for k in range(8)]
    chest = np.tile(np.array([0.0, 0.0, 1.3], np.float32), (8, 1))
    colours, _ = look.colours(ids, UserTraits.of(people), np.arange(8), chest.T)
    assert len({tuple(each) for each in colours.tolist()}) > 3


def test_tags_of_bodies_are_carlas() -> None:
    tags = {name: body_tag(BODIES[name]) for name in ("suv", "van", "bus", "motorcycle", "bicycle", "child")}
    assert tags == {"suv": 14, "van": 15, "bus": 16, "motorcycle": 18, "bicycle": 19, "child": 12}


def test_tags_of_what_stands_beside_the_road_are_carlas() -> None:
    """A signal's head, a fence, a shed of planks, a guard rail, a skip and a post."""
    rng = np.random.default_rng(0)
    wanted = ["TrafficLight", "Fence", "Building", "GuardRail", "Static", "Pole"]
    made = ["signal_head", "fence", "planks", "rail", "skip", "steel"]
    boxes = [box_mesh((0.3, 1.0, 3.0), name).moved(10, 4 * place, 0) for place, name in enumerate(made)]
    static = merge([GROUND, *boxes])
    bodies = InstancedBodies(VARIANTS, MESHES)
    look = StaticLook(static, [], rng)
    seen = Viewer(Scene(static), look, bodies, BodyLook([MESHES[name] for name in VARIANTS])).surfaces(
        rays_to([(10.0, 4.0 * place, 1.5) for place in range(len(made))]), [], 1e-3
    )
    tags = np.zeros(len(made), np.uint8)
    tags[seen.rays] = seen.tags
    assert tags.tolist() == [TAG[name] for name in wanted]
    assert materials.MATERIAL_ID["signal_head"] in traffic_light(rng).materials
    assert materials.MATERIAL_ID["fence"] in enclosure("picket", 5.0, rng).materials


def test_road_users_move_on() -> None:
    (later,) = moved_on([user("sedan", 5.0, 1.0)], 0.1)
    assert later.position_m == pytest.approx([6.0, 1.0, 0.0])
    assert replace(later, id="x").variant is VARIANTS["sedan.0"]


def test_a_round_plate_has_a_red_rim_and_an_octagon_a_red_middle() -> None:
    def plate(corners: int, y_m: float):
        angle = 2 * np.pi * (np.arange(corners) + 0.5 * (corners == 8)) / corners
        points = [(0.0, y_m + 0.4 * np.cos(a), 2 + 0.4 * np.sin(a)) for a in angle]
        return surface(points, [[0, i, i + 1] for i in range(1, corners - 1)], "sign")

    faces = SignFaces.of(merge([GROUND, plate(16, 0.0), plate(8, 3.0)]))
    assert faces.shapes.tolist() == [ROUND, OCTAGON]
    assert faces.face_of_triangle.tolist()[:2] == [-1, -1]
    points = np.array([[0, 0.36, 2.0], [0, 0.0, 2.25], [0, 3.0, 2.2]], np.float32)
    colours = faces.colours(np.array([2, 2, 16]), points)
    assert [each[0] > 5 * each[1] for each in colours.tolist()] == [True, False, True]
