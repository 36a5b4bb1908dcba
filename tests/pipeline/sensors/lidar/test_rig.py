"""Several LiDARs on several vehicles, in one drive: each has its clouds, its frames and its truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.build import se3_from_pose, se3_from_transform
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

SCENARIO = """
name: fleet
simulation: {seed: 4, duration_s: 0.6, warmup_s: 8}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 120, pedestrians: 40}
vehicles:
  ego: {}
  truck_1: {body: box_truck}
sensors:
  lidars:
    lidar: {vehicle: ego, channels: 32, points_per_second: 288000, noise_stddev: 0, imperfections: &sharp
      {weak_noise_m: 0, beam_divergence_deg: 0, ring_elevation_stddev_deg: 0, ring_range_stddev_m: 0}}
    front: {vehicle: ego, preset: vlp-16, x_m: 2.0, z_m: 0.9, yaw_deg: 10, noise_stddev: 0,
      imperfections: *sharp}
    roof: {vehicle: truck_1, channels: 16, points_per_second: 57600, rotation_frequency: 5, z_m: 3.6,
      noise_stddev: 0, imperfections: *sharp}
"""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "fleet.yaml").write_text(SCENARIO)
    simulate(load_scenario(str(folder / "fleet.yaml")), folder / "out")
    return folder / "out" / "clean"


def test_each_lidar_has_its_clouds_at_its_own_rate(bag: Path) -> None:
    topics = BagReader(bag).topics
    counts = {name: topics[f"/{name}/points"].count for name in ("ego/lidar", "ego/front", "truck_1/roof")}
    assert counts == {"ego/lidar": 6, "ego/front": 6, "truck_1/roof": 3}  # 5 turns a second, 10 steps


def test_each_lidars_points_match_the_truth_in_its_frame(bag: Path) -> None:
    """Points of the vehicle that it sits on are none of its own; those of others are in their boxes."""
    for lidar in ("ego/lidar", "ego/front", "truck_1/roof"):
        inside = grown = 0
        for frame in read_frames(bag, lidar_topic=f"/{lidar}/points"):
            assert frame.boxes.ids
            assert lidar.split("/")[0] not in frame.boxes.ids
            boxes = frame.boxes.geometry + np.array([0, 0, 0.08, 0.01, 0.01, -0.16, 0])
            inside += count_points(xyz(frame.cloud), boxes).sum()
            grown += count_points(xyz(frame.cloud), boxes + np.array([0, 0, 0, 0.3, 0.3, 0, 0])).sum()
        assert inside > 100
        assert inside > 0.9 * grown  # mirrors stick out


def test_points_on_a_road_user_are_counted_over_all_lidars_of_the_vehicle(bag: Path) -> None:
    recorded = [message for _, message in BagReader(bag).messages("/ego/ground_truth/road_users")]
    views = (read_frames(bag, lidar_topic=f"/ego/{name}/points") for name in ("lidar", "front"))
    for message, *frames in zip(recorded, *views, strict=True):
        counts = sum(count_points(xyz(frame.cloud), frame.boxes.geometry) for frame in frames)
        assert np.abs(counts - [user.lidar_points for user in message.road_users]).max() <= 2


def test_occluded_road_users_have_their_occlusion(bag: Path) -> None:
    messages = BagReader(bag).messages("/ego/ground_truth/road_users")
    users = [user for _, message in messages for user in message.road_users]
    occlusion = np.array([user.occlusion for user in users])
    points = np.array([user.lidar_points for user in users])
    assert np.all((occlusion >= 0) & (occlusion <= 1))
    assert np.all(points[occlusion == 1] <= 2)
    assert np.median(points[occlusion > 0.8]) < np.median(points[(occlusion < 0.2) & (points > 0)])


def test_tf_carries_the_estimate_and_static_frames_the_mounting(bag: Path) -> None:
    reader = BagReader(bag)
    static = {t.child_frame_id: t for _, m in reader.messages("/tf_static") for t in m.transforms}
    assert set(static) == {"ego/imu", "ego/lidar", "ego/front", "truck_1/imu", "truck_1/roof"}
    front = se3_from_transform(static["ego/front"].transform)
    np.testing.assert_allclose(front[:3, 3], (2.0, 0.0, 0.9), atol=1e-9)
    np.testing.assert_allclose(front[:3, 0], (np.cos(np.deg2rad(10)), np.sin(np.deg2rad(10)), 0), atol=1e-9)
    for (_, tf), (_, estimate), (_, truth) in zip(
        reader.messages("/tf"),
        reader.messages("/truck_1/odometry"),
        reader.messages("/truck_1/ground_truth/odometry"),
        strict=True,
    ):
        carried = {t.child_frame_id: se3_from_transform(t.transform) for t in tf.transforms}
        assert set(carried) == {"ego/base_link", "truck_1/base_link"}
        believed, true = se3_from_pose(estimate.pose.pose), se3_from_pose(truth.pose.pose)
        np.testing.assert_allclose(carried["truck_1/base_link"], believed, atol=1e-12)
        error_m = np.linalg.norm(believed[:3, 3] - true[:3, 3])
        assert 1e-3 < error_m < 6 * np.sqrt(estimate.pose.covariance.reshape(6, 6)[:3, :3].trace())


def test_messages_are_in_the_order_of_their_log_times(bag: Path) -> None:
    reader = BagReader(bag)
    log_times = [raw.log_time_ns for raw in reader.raw_messages(list(reader.topics))]
    assert log_times == sorted(log_times)
    imu = [m.header.stamp.nanosec for _, m in reader.messages("/ego/imu")]
    assert np.diff(imu).tolist() == [10_000_000] * 49


def test_every_sensor_records_the_topics_that_it_declares(bag: Path) -> None:
    recorded = BagReader(bag).topics
    declared: set[str] = set()
    for vehicle in ("ego", "truck_1"):
        for kind, sections in load_scenario("smoke").sensors.carried_by("ego"):
            if not sections:  # a kind of which this scenario has none
                continue
            names = (
                {"ego": ("lidar", "front"), "truck_1": ("roof",)}[vehicle] if "" not in sections else ("",)
            )
            topics = [topic for name in names for topic in kind.topics(vehicle, name)]
            for topic in (*topics, *kind.truth(vehicle)):
                assert (recorded[topic.name].type, recorded[topic.name].qos) == (topic.type, topic.qos)
                declared.add(topic.name)
    assert len(declared) == 3 + 2 * 2 + 2 * 3  # LiDARs, their truth, and GNSS, IMU and wheels
