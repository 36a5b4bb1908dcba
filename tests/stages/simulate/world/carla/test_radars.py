"""Radars of a stand-in server, which like CARLA believes that mirrored actors stand still."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.geometry.transforms import invert, se3
from advpipe.pipeline.messages.radar import RADAR_POINT_DTYPE, scan_from_cdr, xyz_of_returns
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.world.carla.radars import DETECTION, CarlaRadar, check_radar
from advpipe.stages.simulate.world.raycast.world import RaycastSurroundings

Sight = tuple[Path, Path, dict[str, Any]]


@pytest.mark.oracle
def test_every_velocity_is_that_of_the_drive(sight: Sight) -> None:
    """Of what stands, and of road users, whose velocities are SUMO's; the radar is 2.3 m ahead."""
    reader = BagReader(sight[0])
    scans = [scan_from_cdr(raw.cdr).returns for raw in reader.raw_messages(["/ego/radar/scan"])]
    odometry = [message for _, message in reader.messages("/ego/ground_truth/odometry")]
    frames = list(read_frames(sight[0]))
    assert len(scans) == len(frames) == 3
    moving = 0
    for returns, truth, frame in zip(scans, odometry, frames, strict=True):
        twist = truth.twist.twist
        own_mps = np.array([twist.linear.x, twist.linear.y + 2.3 * twist.angular.z, twist.linear.z])
        points_m = xyz_of_returns(returns)
        ahead = points_m / np.linalg.norm(points_m, axis=1)[:, None]
        expected = -(ahead @ own_mps)
        boxes = frame.boxes.transformed(invert(lidar_SE3_radar()))
        for inside, velocity_mps in zip(
            points_in_boxes(points_m, boxes.geometry), boxes.velocity_mps, strict=True
        ):
            expected[inside] += ahead[inside] @ velocity_mps
            moving += len(inside) if np.linalg.norm(velocity_mps) > 1 else 0
        off = np.abs(returns["velocity"] - expected)
        assert (off < 0.02).mean() > 0.99  # a few are on mirrors and bags, outside the boxes
        assert (np.diff(returns["range"]) >= 0).all()
        assert np.abs(np.rad2deg(returns["azimuth"])).max() <= 35.0001
        assert returns["range"].max() <= 90
    assert moving > 20


def lidar_SE3_radar() -> np.ndarray:
    """Boxes of a frame are in its LiDAR's frame, which is 2.6 m above the middle of the vehicle."""
    pose = np.eye(4)
    pose[:3, 3] = [2.3, 0.0, 0.5 - 2.6]
    return pose


@pytest.mark.oracle
def test_its_rays_end_in_the_same_places_in_the_embedded_world(
    sight: Sight,
    sight_settings: dict[str, Any],
    scenario_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Within a millimetre, but for rays that pass an edge: their angles are in single precision."""
    raws = BagReader(sight[0]).raw_messages(["/ego/radar/scan"])
    scans = iter([scan_from_cdr(raw.cdr).returns for raw in raws])
    apart_m: list[np.ndarray] = []

    def radar_hits(around: RaycastSurroundings, name: str, radar_mps: np.ndarray) -> np.ndarray:
        returns = next(scans)
        map_SE3_radar = around._carrier.map_SE3_base @ se3(np.eye(3), [2.3, 0.0, 0.5])
        ahead = xyz_of_returns(returns)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        rays = np.column_stack(
            [np.tile(map_SE3_radar[:3, 3], (len(ahead), 1)), ahead @ map_SE3_radar[:3, :3].T]
        )
        apart_m.append(np.abs(around.cast(rays.astype(np.float32), 300.0).range_m - returns["range"]))
        return np.zeros((0, 4))

    monkeypatch.setattr(RaycastSurroundings, "radar_hits", radar_hits, raising=False)
    simulate(load_scenario(scenario_file, {**sight_settings, "sensors.cameras": {}}), tmp_path / "embedded")
    assert len(apart_m) == 3
    assert (np.concatenate(apart_m) < 1e-3).mean() > 0.99


@pytest.mark.oracle
def test_points_repeat_the_scan_with_an_rcs_of_1_m2(sight: Sight) -> None:
    reader = BagReader(sight[0])
    scan = scan_from_cdr(next(iter(reader.raw_messages(["/ego/radar/scan"]))).cdr).returns
    cdr = next(iter(reader.raw_messages(["/ego/radar/points"]))).cdr
    points = np.frombuffer(cdr[-1 - len(scan) * RADAR_POINT_DTYPE.itemsize : -1], RADAR_POINT_DTYPE)
    assert points["rcs"] == pytest.approx(0.0, abs=1e-4)
    assert points["velocity"].tolist() == scan["velocity"].tolist()
    assert np.stack([points[axis] for axis in "xyz"], axis=1) == pytest.approx(xyz_of_returns(scan), abs=1e-4)
    assert (np.diff(scan["amplitude"][np.argsort(scan["range"])][:: len(scan) // 4]) < 0).all()


class Data:
    """A `carla.RadarMeasurement` of velocity, azimuth, altitude and depth each."""

    def __init__(self, *detections: tuple[float, float, float, float]) -> None:
        self.raw_data = np.array(list(detections), DETECTION).tobytes()


def boxes(*rows: list[float]) -> Boxes:
    """Of x, y, z, length, width, height, and the velocity."""
    array = np.array(rows, np.float64).reshape(-1, 9)
    geometry = np.column_stack([array[:, :6], np.zeros(len(rows))])
    return Boxes(geometry, np.zeros(len(rows), np.int64), ("a",) * len(rows), array[:, 6:])


def test_signs_and_what_carla_lacks() -> None:
    """CARLA's azimuth is positive to the right; a positive velocity moves away."""
    radar = CarlaRadar(RadarSensor(x_m=0, z_m=0.01), 0.1)
    data = Data((-2.0, 0.1, 0.05, 20.0), (-2.0, -0.3, 0.0, 30.0), (5.0, 0.0, 0.0, 0.5))
    own = boxes([0, 0, 0, 4, 2, 2, 0, 0, 0])
    other = boxes([20, -2, 1, 5, 2, 2, 3, 0, 0])
    hits = radar.hits(data, own, other, np.eye(4), None)
    assert hits[:, :3] == pytest.approx(np.array([[20, -0.1, 0.05], [30, 0.3, 0]]), abs=1e-6)
    towards = np.cos(0.1) * np.cos(0.05)
    assert hits[:, 3] == pytest.approx([-2 + 3 * towards, -2.0], rel=1e-6)
    computed = radar.hits(data, own, other, np.eye(4), np.array([10.0, 0, 0]))
    assert computed[:, 3] == pytest.approx([(3 - 10) * towards, -10 * np.cos(0.3)], rel=1e-6)


def test_the_road_beneath_a_vehicle_stands_still() -> None:
    radar = CarlaRadar(RadarSensor(x_m=0, z_m=1.0), 0.1)
    data = Data((0.0, 0.0, float(-np.arcsin(0.05)), 20.0), (0.0, 0.0, float(-np.arcsin(0.03)), 20.0))
    moving = boxes([20, 0, 0.75, 5, 2, 1.5, 10, 0, 0])
    hits = radar.hits(data, boxes(), moving, np.eye(4), None)
    assert hits[:, 3] == pytest.approx([0.0, 10 * np.cos(np.arcsin(0.03))], rel=1e-6)


def test_a_scan_of_several_steps_has_all_their_rays() -> None:
    radar = CarlaRadar(RadarSensor(points_per_second=1500, sensor_tick=0.2), 0.1)
    assert radar.attributes["sensor.other.radar"]["points_per_second"] == 3000
    assert [frame for frame in range(5) if radar.is_due(frame)] == [0, 2, 4]


def test_what_carla_lacks_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    check_radar("sensors.radars.r", RadarSensor(preset="corner"))
    assert "sensors.radars.r: CARLA's radar measures no power" in capsys.readouterr().err
    with pytest.raises(UsageError, match=r"sensors\.radars\.r\.horizontal_fov: .* less than 180 degrees"):
        check_radar("sensors.radars.r", RadarSensor(horizontal_fov=200))
