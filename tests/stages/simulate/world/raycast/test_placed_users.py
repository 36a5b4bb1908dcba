"""Road users as arrays: rotations are those of linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import invert, se3_from_yaw, transform_points
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.body_meshes import body_meshes
from advpipe.stages.simulate.world.raycast.instanced_bodies import InstancedBodies
from advpipe.stages.simulate.world.raycast.placed_users import PlacedUsers

VARIANTS = draw_variants(np.random.default_rng(0))
BODIES = InstancedBodies(VARIANTS, body_meshes(VARIANTS, {}))


def users(count: int = 3) -> list[RoadUser]:
    variants = list(VARIANTS.values())
    return [
        RoadUser(f"u{k}", variants[k], se3_from_yaw((10.0 * k, 3.0, 0.2 * k), 0.7 * k), np.zeros(3))
        for k in range(count)
    ]


def test_vectors_and_points_turn_with_their_users() -> None:
    everyone = users()
    placed = BODIES.placed(everyone)
    user_of, vectors = np.array([2, 0, 1, 2]), np.random.default_rng(1).normal(size=(3, 4)).astype(np.float32)
    turned, back = placed.turned(user_of, vectors), np.stack(placed.turned_back(user_of, vectors))
    local = placed.local_points(user_of, vectors)
    for column, user in enumerate(user_of.tolist()):
        pose = everyone[user].map_SE3_base
        assert turned[:, column] == pytest.approx(pose[:3, :3] @ vectors[:, column], abs=1e-5)
        assert back[:, column] == pytest.approx(pose[:3, :3].T @ vectors[:, column], abs=1e-5)
        expected = transform_points(invert(pose), vectors[:, column].astype(np.float64)[None])[0]
        assert local[:, column] == pytest.approx(expected, abs=1e-4)


def test_they_are_those_that_were_placed() -> None:
    everyone = users()
    placed = BODIES.placed(everyone)
    assert list(placed) == everyone
    assert placed.map_SE3_box[2][:3, 3] == pytest.approx([20, 3, 0.4 + everyone[2].variant.height_m / 2])
    assert placed.traits.height_m.tolist() == pytest.approx([each.variant.height_m for each in everyone])


def test_the_same_users_are_placed_once_and_others_anew() -> None:
    everyone = users()
    placed = BODIES.placed(everyone)
    assert BODIES.placed(list(everyone)) is placed
    assert BODIES.placed(placed) is placed
    assert BODIES.placed(users()) is not placed  # they may stand elsewhere
    assert len(BODIES.placed([])) == 0
    assert isinstance(BODIES.placed(everyone[:1]), PlacedUsers)
