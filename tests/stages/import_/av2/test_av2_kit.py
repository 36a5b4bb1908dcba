"""Argoverse 2's own package beside our import."""

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.stages.export.recorded import recorded_frames
from tests.stages.import_.av2.tiny_av2 import stamps, write_av2
from tests.stages.import_.importing import import_form

pytestmark = [pytest.mark.oracle, pytest.mark.usefixtures("stand_ins")]


def test_it_agrees_on_points_poses_and_boxes(tmp_path):
    pytest.importorskip("av2.utils.io")
    from av2.structures.cuboid import CuboidList
    from av2.structures.sweep import Sweep
    from av2.utils.io import read_city_SE3_ego

    log = write_av2(tmp_path / "log")
    poses = read_city_SE3_ego(log)
    cuboids = CuboidList.from_feather(log / "annotations.feather")
    bag = import_form("av2", log, tmp_path / "set", classes={"SIGN": "car", "BICYCLE": "car"}).bag
    for stamp, frame in zip(stamps(), recorded_frames(bag, "/ego/lidar/points"), strict=True):
        sweep = Sweep.from_feather(log / "sensors" / "lidar" / f"{stamp}.feather")
        cloud = frame.cloud
        assert np.column_stack([cloud["x"], cloud["y"], cloud["z"]]).tolist() == sweep.xyz.tolist()
        assert cloud["ring"].tolist() == sweep.laser_number.tolist()
        assert cloud["intensity"] * 255 == pytest.approx(sweep.intensity, rel=3e-7)
        assert cloud["time"] * 1e9 == pytest.approx(sweep.offset_ns, abs=10)
        assert np.allclose(poses[stamp].transform_matrix, frame.map_SE3_lidar, rtol=0, atol=1e-9)
        theirs = [cuboid.transform(poses[stamp]) for cuboid in cuboids if cuboid.timestamp_ns == stamp]
        for cuboid, geometry in zip(theirs, frame.boxes.geometry, strict=True):
            distances = np.linalg.norm(cuboid.vertices_m[:, None] - box_corners(geometry[None])[0], axis=2)
            assert distances.min(axis=0).max() < 1e-9
            heading = cuboid.dst_SE3_object.rotation[:2, 0]
            assert heading == pytest.approx([np.cos(geometry[6]), np.sin(geometry[6])], abs=1e-9)


def test_it_agrees_on_the_sensors_mounts(tmp_path):
    io = pytest.importorskip("av2.utils.io")
    from advpipe.stages.import_.av2.log import Av2Log

    log = write_av2(tmp_path / "log")
    theirs = io.read_ego_SE3_sensor(log)
    ours = {child.partition("/")[2]: pose for _, child, pose in Av2Log(log, {}).static_transforms[1:]}
    assert set(ours) == set(theirs)
    for name, pose in theirs.items():
        assert np.allclose(pose.transform_matrix, ours[name], atol=1e-12)
