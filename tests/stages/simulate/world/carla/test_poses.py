"""Poses against CARLA's own transforms."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.stages.simulate.world.carla.poses import ActorBox, pose_of, transform_of

carla = pytest.importorskip("carla")
pytestmark = pytest.mark.oracle

MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize("seed", range(5))
def test_poses_are_carlas_with_the_y_axis_mirrored(seed: int) -> None:
    x, y, z, roll, pitch, yaw = np.random.default_rng(seed).uniform(-80, 80, 6)
    transform = carla.Transform(carla.Location(x, y, z), carla.Rotation(pitch=pitch, yaw=yaw, roll=roll))
    ours = pose_of(transform)
    assert ours == pytest.approx(MIRROR @ np.array(transform.get_matrix()) @ MIRROR, abs=1e-4)
    assert pose_of(transform_of(ours)) == pytest.approx(ours, abs=1e-4)


def test_the_stand_ins_transforms_are_carlas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent / "standin"))
    import geometry

    pose = [3.0, -4.0, 5.0, 12.0, 100.0, -20.0]
    transform = carla.Transform(carla.Location(*pose[:3]), carla.Rotation(*pose[3:]))
    assert geometry.matrix_of(pose) == pytest.approx(np.array(transform.get_matrix()), abs=1e-5)
    assert geometry.pose_of(geometry.matrix_of(pose)) == pytest.approx(pose, abs=1e-9)
    sys.modules.pop("geometry")


def test_an_actor_stands_where_its_box_does() -> None:
    """A vehicle's origin is on the ground, here off the middle; a pedestrian's in the body's middle."""
    for place, ground_m in (((0.3, 0.1, 0.7), (0.3, -0.1, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, -0.7))):
        box = ActorBox.of(carla.BoundingBox(carla.Location(*place), carla.Vector3D(2.0, 1.0, 0.7)))
        assert box.sizes_m == pytest.approx([4.0, 2.0, 1.4])
        assert box.actor_SE3_base[:3, 3] == pytest.approx(ground_m, abs=1e-6)
        pose = np.eye(4)
        assert box.map_SE3_actor(pose) @ box.actor_SE3_base == pytest.approx(pose)
