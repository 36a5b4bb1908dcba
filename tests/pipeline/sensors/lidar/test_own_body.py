"""A LiDAR sees the roof of the vehicle that it sits on."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.mesh import box_mesh, surface
from advpipe.stages.simulate.world.raycast.scene import Float32, Scene

GROUND = Scene(surface([[-200, -200, 0], [200, -200, 0], [0, 300, 0]], [[0, 1, 2]], "asphalt"))


class Carrier:
    """A vehicle that is a box of 4 x 1.6 x 1.5 m."""

    def cast_own_body(self, rays: Float32) -> Hits:
        return Scene(box_mesh((4.0, 1.6, 1.5), "paint_white")).cast(rays)


def cloud(own_body: bool = True, **keys: float) -> np.ndarray:
    sensor = LidarSensor(
        channels=40, lower_fov=-40, upper_fov=-1, points_per_second=40 * 360 * 10, noise_stddev=0,
        dropoff_general_rate=0, dropoff_intensity_limit=0,
        imperfections=IDEAL.model_copy(update={"own_body": own_body}), **keys,
    )  # fmt: skip
    lidar = Lidar(sensor)
    lidar.mount_on(Carrier())
    return lidar.measure(GROUND.cast(lidar.rays(np.eye(4))), np.random.default_rng(0))


def test_the_roof_is_hit_and_hides_the_ground_behind_it() -> None:
    points = cloud(z_m=2.0)
    z_m, forward = points["z"] + 2.0, np.abs(points["y"]) < 0.01
    roof = z_m > 1.4
    assert np.allclose(z_m[roof], 1.5, atol=1e-4)
    assert np.allclose(z_m[~roof], 0.0, atol=1e-3)
    # 0.5 m above the roof, 2 m before its end: the ground is seen beyond 2 / 0.5 x 2 = 8 m ahead, and
    # 0.8 / 0.5 x 2 = 3.2 m to the side. Returns nearer than 0.9 m are none.
    assert np.abs(points["x"][forward & ~roof]).min() == pytest.approx(8.2, abs=0.3)
    assert np.abs(points["y"][~roof & (np.abs(points["x"]) < 0.1)]).min() == pytest.approx(3.3, abs=0.15)
    assert np.linalg.norm(xyz(points[roof]), axis=1).min() >= 0.9
    assert 0 < roof.sum() < (~roof).sum()


def test_without_it_or_from_inside_the_body_is_not_seen() -> None:
    assert (cloud(own_body=False, z_m=2.0)["z"] < -1.9).all()
    assert (cloud(z_m=1.2)["z"] < -1.1).all()
