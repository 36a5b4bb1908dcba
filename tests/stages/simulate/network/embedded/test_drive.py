"""What CAMs of a drive tell, against the truth and the estimates in the same bag."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import yaw_of
from advpipe.pipeline.messages.build import se3_from_pose, stamp_ns
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.simulate.run import simulate

Record = Callable[..., BagReader]
LONG = ("simulation.duration_s=4", "traffic.vehicles=100", "v2x.penetration=1")
PLANE = pyproj.Proj("+proj=tmerc +lat_0=48.1351 +lon_0=11.582 +k=1 +datum=WGS84 +units=m")
MS = 1_000_000


@dataclass(frozen=True)
class SentCam:
    """A CAM on its way out, and the truth of the station at the step that it tells of."""

    time_ns: int
    vehicle: str
    cam: Cam
    state_ns: int
    map_SE3_base: np.ndarray
    velocity_mps: np.ndarray
    size_m: tuple[float, float, float]

    @property
    def centre_m(self) -> np.ndarray:
        """The ground below the middle of the box according to the CAM: half a length behind its position."""
        x_m, y_m = PLANE(self.cam.longitude_deg, self.cam.latitude_deg)
        yaw_rad = math.pi / 2 - self.cam.heading_rad
        return np.array([x_m, y_m]) - self.size_m[0] / 2 * np.array([math.cos(yaw_rad), math.sin(yaw_rad)])


def sent_cams(reader: BagReader) -> list[SentCam]:
    found = []
    for step in V2xDrive(reader).steps():
        places = {place.station_id: place for place in step.radios}
        for sent in step.sent:
            _, vehicle, pose, size_m, velocity_mps = places[sent.station_id]
            cam = decode_cam(sent.payload)
            found.append(SentCam(sent.request_ns, vehicle, cam, step.begin_ns, pose, velocity_mps, size_m))
    return found


@pytest.fixture
def cams(drive: Record) -> list[SentCam]:
    return sent_cams(drive(*LONG))


def test_other_stations_report_the_truth_with_the_configured_errors(cams: list[SentCam]) -> None:
    """Half a metre a horizontal axis, half a degree, 0.1 m/s: the errors of one station hang together."""
    errors = defaultdict(list)
    for one in cams:
        if one.vehicle == "ego":
            continue
        true_mps = abs(float(one.map_SE3_base[:3, 0] @ one.velocity_mps))
        turned = math.pi / 2 - one.cam.heading_rad - yaw_of(one.map_SE3_base)
        errors[one.vehicle].append(
            [
                *(one.centre_m - one.map_SE3_base[:2, 3]),
                math.degrees(math.remainder(turned, math.tau)),
                one.cam.speed_mps - true_mps if true_mps > 0.5 else 0.0,
            ]
        )
        assert one.cam.length_m == pytest.approx(one.size_m[0], abs=0.1001)
        assert one.cam.width_m == pytest.approx(one.size_m[1], abs=0.1001)
        assert one.cam.altitude_m == pytest.approx(520, abs=0.02)
        assert one.cam.generation_delta_time_ms == generation_delta_time_ms(one.state_ns)
    means = np.array([np.mean(values, axis=0) for values in errors.values()])
    assert len(means) > 60
    root_mean_square = np.sqrt(np.mean(np.square(means), axis=0))
    np.testing.assert_allclose(root_mean_square[:3], [0.5, 0.5, 0.5], rtol=0.3)
    assert 0.03 < root_mean_square[3] < 0.15
    assert abs(means[:, :3].mean()) < 0.15


def test_instrumented_vehicles_report_their_estimate(drive: Record, cams: list[SentCam]) -> None:
    reader = drive(*LONG)
    estimates = {stamp_ns(message): message for _, message in reader.messages("/ego/odometry")}
    own = [one for one in cams if one.vehicle == "ego"]
    assert len(own) > 5
    differs = 0.0
    for one in own:
        estimate = estimates[one.state_ns]
        pose = se3_from_pose(estimate.pose.pose)
        # 0.1 microdegrees are 11 mm; half of the heading's tenth of a degree moves the centre by 2 mm.
        assert np.abs(one.centre_m - pose[:2, 3]).max() < 0.015
        off_rad = math.remainder(math.pi / 2 - one.cam.heading_rad - yaw_of(pose), math.tau)
        assert abs(math.degrees(off_rad)) < 0.051
        forward_mps = abs(estimate.twist.twist.linear.x)
        assert forward_mps - 1e-9 <= one.cam.speed_mps <= forward_mps + 0.01
        assert one.cam.yaw_rate_radps == pytest.approx(
            estimate.twist.twist.angular.z, abs=math.radians(0.006)
        )
        covariance = np.reshape(estimate.pose.covariance, (6, 6))[:2, :2]
        assert one.cam.semi_major_m == pytest.approx(
            2.4477 * math.sqrt(np.linalg.eigvalsh(covariance)[1]), abs=0.011
        )
        differs = max(differs, float(np.abs(pose[:2, 3] - one.map_SE3_base[:2, 3]).max()))
    assert differs > 0.05  # or the test could not tell it from the truth


def test_cam_rates_and_triggers_follow_the_standard(cams: list[SentCam]) -> None:
    """From one CAM to the next there is a reason: 4 m, 4 degrees, 0.5 m/s, or a second; never below 0.1 s."""
    by_station = defaultdict(list)
    for one in cams:
        by_station[one.vehicle].append(one)
    waited_s = []
    for station in by_station.values():
        for before, after in pairwise(station):
            waited = (after.time_ns - before.time_ns) / 1e9
            waited_s.append(waited)
            assert 0.1 <= waited <= 1.0
            assert (after.time_ns - before.time_ns) % (100 * MS) == 0
    assert len(waited_s) > 500
    assert min(waited_s) == 0.1
    assert max(waited_s) == 1.0
    moving = [one for one in cams if np.linalg.norm(one.velocity_mps) > 11]
    standing = [one for one in cams if np.linalg.norm(one.velocity_mps) < 0.01]
    assert moving
    assert standing
    for station in by_station.values():
        for before, after in pairwise(station):
            if np.linalg.norm(before.velocity_mps) > 11 and np.linalg.norm(after.velocity_mps) > 11:
                assert after.time_ns - before.time_ns <= 500 * MS  # 4 m take 0.36 s


def test_path_history_follows_the_driven_path(drive: Record, cams: list[SentCam]) -> None:
    """The points, added up from the reference position, were passed by the vehicle's front."""
    last = [one for one in cams if one.vehicle == "ego" and one.cam.low_frequency][-1]
    passed = [
        (pose := se3_from_pose(message.pose.pose))[:2, 3] + pose[:2, 0] * last.size_m[0] / 2
        for _, message in drive(*LONG).messages("/ego/odometry")
    ]
    latitude_deg, longitude_deg = last.cam.latitude_deg, last.cam.longitude_deg
    assert last.cam.low_frequency is not None
    assert len(last.cam.low_frequency.path_history) >= 1
    for point in last.cam.low_frequency.path_history:
        latitude_deg += point.delta_latitude_deg
        longitude_deg += point.delta_longitude_deg
        place_m = np.array(PLANE(longitude_deg, latitude_deg))
        assert min(np.linalg.norm(place_m - other) for other in passed) < 0.1


def test_the_local_dynamic_map_is_near_the_truth(drive: Record) -> None:
    """Entries lie where their vehicles were at their generation, as far as receivers know."""
    reader = drive(*LONG)
    truth: dict[tuple[int, int], Any] = {}
    for step in V2xDrive(reader).steps():
        for place in step.radios:
            truth[place.station_id, step.begin_ns] = place.map_SE3_base[:2, 3]
    errors_m, ages_s = [], []
    for _, message in reader.messages("/ego/ldm"):
        for item in message.objects:
            generation_ns = item.generation_time.sec * 10**9 + item.generation_time.nanosec
            centre_m = np.array([item.centre.x, item.centre.y])
            errors_m.append(np.linalg.norm(centre_m - truth[item.station_id, generation_ns]))
            ages_s.append(item.age)
    assert len(errors_m) > 200
    assert np.sqrt(np.mean(np.square(errors_m))) == pytest.approx(0.5 * math.sqrt(2), rel=0.3)
    assert min(ages_s) > 0
    assert max(ages_s) <= 1.1 + 1e-6


def test_inspect_reports_road_users_and_v2x(drive: Record) -> None:
    reader = drive(*LONG)
    description = describe(reader.path)
    boxes = sum(len(message.detections) for _, message in reader.messages("/ego/ground_truth/objects"))
    assert sum(item.boxes for item in description.objects) == boxes
    assert description.v2x is not None
    assert description.v2x.cams == reader.topics["/v2x/sent"].count


def test_penetration_sets_the_share_of_equipped_vehicles(drive: Record) -> None:
    """Only instrumented vehicles; half; all motor vehicles, but no bicycles."""
    senders = {
        share: {one.vehicle for one in sent_cams(drive(*LONG[:2], f"v2x.penetration={share}"))}
        for share in ("0", "0.5", "1")
    }
    assert senders["0"] == {"ego"}
    assert senders["0.5"] < senders["1"]
    assert len(senders["0.5"]) == pytest.approx(len(senders["1"]) / 2, abs=12)


def test_disabled_v2x_records_no_v2x_topics(drive: Record) -> None:
    reader = drive("v2x.enabled=false")
    assert not [name for name in reader.topics if "v2x" in name or "ldm" in name]
    assert describe(reader.path).v2x is None


def test_a_vehicle_has_a_station_while_it_is_on_the_road(tmp_path: Path) -> None:
    """On the road from 1 s to 2 s, it has a radio and sends for so long."""
    rows = [f"visitor,{time_s:.1f},{12 * time_s:.1f},2.0,0,0,sedan" for time_s in (1.0, 1.5, 2.0)]
    (tmp_path / "t.csv").write_text("\n".join(["id,time_s,x_m,y_m,z_m,yaw_rad,body", *rows, ""]))
    settings = [
        "simulation.duration_s=3",
        f"trajectories.file={tmp_path / 't.csv'}",
        "v2x.penetration=1",
        "sensors.lidars.lidar.channels=1",
        "sensors.lidars.lidar.points_per_second=1000",
    ]
    simulate(load_scenario("smoke", settings), tmp_path / "out")
    steps = list(V2xDrive(BagReader(tmp_path / "out" / "clean")).steps())
    start_ns = steps[0].begin_ns
    places = {
        (step.begin_ns - start_ns) // MS: radio
        for step in steps
        for radio in step.radios
        if radio.vehicle == "visitor"
    }
    assert list(places) == list(range(1000, 2001, 100))
    assert places[1500].map_SE3_base[:2, 3] == pytest.approx([18, 2])
    ids = {radio.station_id for radio in places.values()}
    assert len(ids) == 1
    sent_ms = [
        (one.request_ns - start_ns) / MS for step in steps for one in step.sent if one.station_id in ids
    ]
    assert 2 <= len(sent_ms) <= 10
    assert min(sent_ms) >= 1100
    assert max(sent_ms) < 2100
