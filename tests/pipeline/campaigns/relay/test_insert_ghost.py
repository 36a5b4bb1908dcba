"""Ghost insertion, compared with Open3D's ray casting."""

import math

import numpy as np
import pytest
from relay_messages import cloud

from advpipe.pipeline.campaigns.relay.insert_ghost import InsertGhost
from advpipe.pipeline.detector.no_detector import NoDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.attack.lidar.result_checks import refuse_invalid, refuse_out_of_bounds


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("angle_deg", "yaw_deg", "distance_m"), [(0, 0, 12), (130, 35, 9), (-90, 90, 14), (0, 0, 1.5)]
)
def test_rays_end_where_open3d_says(angle_deg: float, yaw_deg: float, distance_m: float) -> None:
    open3d = pytest.importorskip("open3d")
    attack = InsertGhost(distance_m=distance_m, angle_deg=angle_deg, yaw_deg=yaw_deg, noise_m=0)
    clean = cloud(20_000)
    result = attack(clean, Boxes(), NoDetector(), np.random.default_rng(0))
    box = open3d.geometry.TriangleMesh.create_box(4.2, 1.8, 1.5)
    box.translate((-2.1, -0.9, -0.75))
    box.rotate(box.get_rotation_matrix_from_xyz((0, 0, math.radians(yaw_deg))), center=(0, 0, 0))
    angle_rad = math.radians(angle_deg)
    box.translate((distance_m * math.cos(angle_rad), distance_m * math.sin(angle_rad), -1.8 + 0.75))
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(open3d.t.geometry.TriangleMesh.from_legacy(box))
    points_m = xyz(clean)
    rays = np.concatenate([np.zeros_like(points_m), points_m], axis=1).astype(np.float32)
    share = scene.cast_rays(open3d.core.Tensor(rays))["t_hit"].numpy()
    hit = share < 1
    if distance_m > 5:  # from inside, rays would only leave it
        assert 100 < hit.sum() < len(clean) / 2
        assert result.labels.point.tolist() == np.flatnonzero(hit).tolist()
        assert np.allclose(xyz(result.cloud)[hit], points_m[hit] * share[hit, None], atol=1e-3)
    touched = np.zeros(len(clean), bool)
    touched[result.labels.point] = True
    assert np.array_equal(result.cloud[~touched], clean[~touched])
    refuse_invalid("insert-ghost", clean, result)
    refuse_out_of_bounds("insert-ghost", attack, clean, result)
