"""Drives through CARLA's genuine client and a stand-in server of our own, which has our ray-cast world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.cloud import SEMANTIC_POINT_DTYPE, Cloud, xyz
from advpipe.pipeline.messages.radar import scan_from_cdr, xyz_of_returns
from advpipe.pipeline.messages.topic_names import published_name
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.traffic.road_users import RoadUser

pytestmark = pytest.mark.oracle

COLUMNS = 600


def drive(out: Path, scenario_file: Path, server: Any = None, **settings: object) -> Path:
    keys = {} if server is None else {"world": "carla", "carla.server": server.address, "carla.timeout_s": 60}
    simulate(load_scenario(scenario_file, {**keys, **settings}), out)
    return out / "clean"


def rays_of(cloud: Cloud) -> np.ndarray:
    """The number of each point's ray."""
    azimuth = np.arctan2(cloud["y"].astype(float), cloud["x"].astype(float))
    columns = np.rint((np.pi - azimuth) / (2 * np.pi) * COLUMNS).astype(int) % COLUMNS
    return columns * 16 + cloud["ring"]


def near(cloud: Cloud) -> Cloud:
    return cloud[np.linalg.norm(xyz(cloud), axis=1) < 94]


@pytest.fixture(scope="module")
def drives(
    shared_server: Any, scenario_file: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path, dict[str, Any]]:
    """The same drive through CARLA and in the embedded world, and the server's state after it."""
    folder = tmp_path_factory.mktemp("drives")
    rain = {"environment.weather": {"kind": "rain", "rate_mm_per_h": 25}}
    through_carla = drive(folder / "carla", scenario_file, shared_server, **rain)
    return through_carla, drive(folder / "embedded", scenario_file), shared_server.state


def test_the_same_rays_give_the_same_points_within_a_millimetre(drives: tuple[Path, Path, Any]) -> None:
    """Up to 94 m: the embedded world leaves out bodies whose middle is beyond the LiDAR's range of 100 m."""
    compared = 0
    for frames in zip(*(read_frames(bag) for bag in drives[:2]), strict=True):
        ours, embedded = (near(frame.cloud) for frame in frames)
        assert np.array_equal(rays_of(ours), rays_of(embedded))
        apart_m = np.linalg.norm(xyz(ours) - xyz(embedded), axis=1)
        assert apart_m.max() < 1e-3
        compared += len(apart_m)
    assert compared > 4 * 3000


def test_the_truth_is_that_of_the_actors(drives: tuple[Path, Path, Any]) -> None:
    """Boxes by the actors' own boxes, and occlusion by the numbers of the semantic LiDAR."""
    points: list[tuple[int, int]] = []
    hidden: list[tuple[float, float]] = []
    readers = [BagReader(bag) for bag in drives[:2]]
    for (_, one), (_, other) in zip(
        *(reader.messages("/ego/ground_truth/road_users") for reader in readers), strict=True
    ):
        assert [user.id for user in one.road_users] == [user.id for user in other.road_users]
        for ours, embedded in zip(one.road_users, other.road_users, strict=True):
            points.append((ours.lidar_points, embedded.lidar_points))
            hidden.append((ours.occlusion, embedded.occlusion))
    ours, embedded = np.array(points).T
    assert embedded.max() > 10
    assert np.abs(ours - embedded).max() <= 1  # the embedded world leaves out bodies at the range's end
    ours, embedded = np.array(hidden)[embedded > 3].T  # shares of one or two rays say nothing
    assert len(ours) > 10
    assert np.abs(ours - embedded).max() < 0.25
    assert np.abs(ours - embedded).mean() < 0.05
    for frame, other in zip(*(read_frames(bag) for bag in drives[:2]), strict=True):
        assert frame.boxes.geometry == pytest.approx(other.boxes.geometry, abs=1e-5)


def test_the_server_is_left_as_it_was(drives: tuple[Path, Path, Any]) -> None:
    state = drives[2]
    assert state["synchronous"] is False
    assert [one[1] for one in state["actors"] if one[1] != "traffic.traffic_light"] == ["spectator"]
    assert state["map"] == "OpenDriveMap"
    assert state["weather"][1] == 50  # rain of 25 mm/h
    assert ["frozen", True] in state["history"]
    assert ["frozen", False] in state["history"]
    assert all(not frozen for _, frozen in state["signals"].values())


def test_signals_and_lamps_are_shown(drives: tuple[Path, Path, Any]) -> None:
    history = drives[2]["history"]
    assert {entry[2] for entry in history if entry[0] == "light"} >= {0, 2}  # red and green
    lamps = [entry for entry in history if entry[0] == "lamps"]
    assert {entry[1].split()[0] for entry in lamps} == {"advpipe"}
    assert any(entry[2] & 8 for entry in lamps)  # somebody brakes


def test_carlas_losses_are_set_from_the_scenario(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    """By default, CARLA's LiDAR loses 45 % of its points."""
    keys = {"simulation.duration_s": 0.1, "sensors.lidars.lidar.dropoff_general_rate": 0.25}
    few = next(iter(read_frames(drive(tmp_path / "few", scenario_file, server, **keys)))).cloud
    keys["sensors.lidars.lidar.dropoff_general_rate"] = 0.0
    everything = next(iter(read_frames(drive(tmp_path / "all", scenario_file, server, **keys)))).cloud
    assert len(few) / len(everything) == pytest.approx(0.75, abs=0.02)
    share = np.isin(rays_of(few), rays_of(everything)).mean()
    assert share == 1.0


def test_the_bridges_semantic_lidar_is_recorded(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    """With the fields of CARLA's ROS bridge; each point of the cloud is among its points."""
    keys = {"simulation.duration_s": 0.2, "recording.names": "carla_ros_bridge"}
    bag = drive(tmp_path / "bridge", scenario_file, server, **keys)
    topics = VehicleTopics("ego", "lidar")
    frames = list(read_frames(bag))
    messages = [message for _, message in BagReader(bag).messages(topics.semantic_points.name)]
    assert len(messages) == len(frames) == 2
    assert published_name(topics.semantic_points.name, "carla_ros_bridge") == "/carla/ego/semantic_lidar"
    for frame, message in zip(frames, messages, strict=True):
        assert [(field.name, field.datatype) for field in message.fields] == [
            *((name, 7) for name in ("x", "y", "z", "CosAngle")),
            *(("ObjIdx", 6), ("ObjTag", 6)),
        ]
        assert message.header.frame_id == "ego/lidar"
        points = np.frombuffer(message.data.tobytes(), SEMANTIC_POINT_DTYPE)
        assert set(map(tuple, np.round(xyz(frame.cloud), 2).tolist())) <= set(
            map(tuple, np.round(xyz(points), 2).tolist())
        )
        assert (np.abs(points["CosAngle"]) <= 1).all()
        assert len(set(points["ObjIdx"].tolist())) > 2
        assert len(set(points["ObjTag"].tolist())) > 2


@pytest.mark.usefixtures("drives")  # which has the map loaded, so that actors on it stay
def test_carla_drives(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    """Traffic Manager drives ego, another client's actors stand there; SUMO's traffic goes on around them."""
    server.spawn("vehicle.standin.suv_0", 80.0, -80.0, 0.0)
    server.spawn("walker.pedestrian.child_0", 100.0, -78.0, 0.6)
    server.faults(flips=True)
    keys = {"vehicles.ego.driver": "carla", "carla.traffic_manager_port": 8755}
    keys |= {
        "simulation.duration_s": 2.0,
        "sensors.lidars.lidar.z_m": 1.8,
        "sensors.lidars.lidar.lower_fov": -40,
        "sensors.lidars.lidar.range": 150,
    }
    keys |= {"sensors.gnss": {"white_stddev_m": 0, "drift_stddev_m": 0}}
    keys |= {
        "sensors.cameras": {"front": {"image_size_x": 96, "image_size_y": 64, "z_m": 2.4, "range": 200}},
        "sensors.radars": {"radar": {"elevation_resolution_deg": 2, "points_per_second": 3000}},
    }
    bag = drive(tmp_path / "driven", scenario_file, server, **keys)
    reader = BagReader(bag)
    truth = [message for _, message in reader.messages("/ego/ground_truth/odometry")]
    places = np.array([(one.pose.pose.position.x, one.pose.pose.position.y) for one in truth])
    assert np.linalg.norm(places[-1] - places[0]) > 3
    estimated = [message.pose.pose.position for _, message in reader.messages("/ego/odometry")]
    apart_m = np.linalg.norm([(one.x, one.y) for one in estimated] - places, axis=1)
    assert apart_m[-1] < 2.0  # the filter follows CARLA's GNSS and IMU
    frames = list(read_frames(bag))
    known = {name for frame in frames for name in frame.boxes.ids}
    assert sum(name.startswith("carla.") for name in known) == 2
    assert any(not name.startswith("carla.") for name in known)
    for frame in frames:  # points on the own vehicle are left out
        near = np.abs(xyz(frame.cloud)) < (1.5, 0.7, 1.75)
        assert not near.all(axis=1).any()
    images = list(reader.messages("/ego/front/image/compressed"))
    assert len(images) == len(frames)
    labelled = {
        one.id for _, message in reader.messages("/ego/ground_truth/front/labels") for one in message.labels
    }
    assert labelled
    for raw, message in zip(reader.raw_messages(["/ego/radar/scan"]), truth, strict=True):
        returns = scan_from_cdr(raw.cdr).returns
        ahead = xyz_of_returns(returns) / returns["range"][:, None]
        on_road = returns["range"] * ahead[:, 2] < -0.48  # comes nearer, as fast as in the last step
        rate_mps = np.median(returns["velocity"][on_road] / ahead[on_road, 0])
        assert rate_mps == pytest.approx(-message.twist.twist.linear.x, abs=0.5)
    sent = {message.station_id for _, message in reader.messages("/v2x/sent")}
    assert len(sent) > 1
    assert server.state["managers"] == []
    assert len(server.bodies()) == 2


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"carla.map": "Town10"},
            r"carla.map 'Town10' is not a map of the server .* did you mean 'Town10HD'",
        ),
        ({"carla.map": "Town10HD"}, r"CARLA's map Town10HD does not fit the scenario's road network"),
        (
            {"carla.blueprints": {"sedan": "vehicle.standin.sedan_9"}},
            r"carla.blueprints.sedan 'vehicle.standin.sedan_9' is not a blueprint .* did you mean",
        ),
        (
            {"simulation.step_s": 0.4, "sensors.lidars.lidar.rotation_frequency": 2.5},
            "CARLA's physics allows steps",
        ),
        ({"sensors.lidars.lidar.motion_distortion": True}, "all rays of CARLA's LiDAR leave at once"),
        (
            {"sensors.lidars.lidar.channels": 2, "sensors.lidars.lidar.vertical_angles_deg": [-9, 1]},
            "CARLA spaces a LiDAR's channels evenly",
        ),
        ({"sensors.lidars.lidar.range_reflectivity": 0.1}, "CARLA's surfaces have no reflectivity"),
    ],
)
def test_bad_settings(
    settings: dict[str, object], message: str, server: Any, scenario_file: Path, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=message):
        drive(tmp_path / "out", scenario_file, server, **settings)
    assert server.state["synchronous"] is False
    assert server.bodies() == []
    assert not (tmp_path / "out").exists()


def test_another_release_is_refused(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    server.faults(version="0.9.15")
    with pytest.raises(UsageError, match=r"is CARLA 0\.9\.15, but 0\.9\.16 is needed"):
        drive(tmp_path / "out", scenario_file, server)


def test_a_second_client_that_ticks_is_noticed(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    server.faults(intruder_at=9)
    with pytest.raises(AdvpipeError, match="another client ticks the server, too"):
        drive(tmp_path / "out", scenario_file, server)
    assert server.state["synchronous"] is False
    assert server.bodies() == []


def test_first_measurements_may_be_lost(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    """A real server loses those of the first ticks after a subscription."""
    keys = {"simulation.duration_s": 0.2}
    whole = list(read_frames(drive(tmp_path / "whole", scenario_file, server, **keys)))
    server.faults(loses=list(range(1, 13)))
    later = list(read_frames(drive(tmp_path / "later", scenario_file, server, **keys)))
    for one, other in zip(whole, later, strict=True):
        assert one.cloud.tobytes() == other.cloud.tobytes()


@pytest.mark.nightly  # waits
@pytest.mark.parametrize(
    ("ticks", "message"),
    [
        ([12], r"CARLA's sensor .* of ego.* sent nothing for frame \d+ within 12 s"),
        (list(range(200)), r"CARLA's sensor .* of ego.* sends nothing, after 20 ticks and 12 s"),
    ],
)
def test_a_lost_measurement_is_noticed_by_its_frame(
    ticks: list[int], message: str, server: Any, scenario_file: Path, tmp_path: Path
) -> None:
    """None of another frame takes its place."""
    server.faults(loses=ticks)
    keys = {"simulation.duration_s": 1, "carla.timeout_s": 12}
    with pytest.raises(AdvpipeError, match=message):
        drive(tmp_path / "out", scenario_file, server, **keys)
    assert server.state["synchronous"] is False
    assert server.bodies() == []


def test_a_vehicle_that_leaves_takes_its_sensors_along(
    server: Any, scenario_file: Path, tmp_path: Path
) -> None:
    from advpipe.stages.simulate.world.carla.world import CarlaWorld

    scenario = load_scenario(scenario_file, {"carla.server": server.address})
    variants = draw_variants(np.random.default_rng(3), scenario.bodies)
    network = load_network(scenario.map, tmp_path, scenario.simulation.seed)
    ego = RoadUser("ego", variants["sedan.0"], se3_from_yaw([20.0, 30.0, 0.0], 0.0), np.zeros(3))
    with CarlaWorld(scenario, network, variants) as world:
        world.advance(0, [ego], {})
        assert sum("sensor" in one[1] for one in server.state["actors"]) == 3
        world.advance(1, [], {})
        assert not any("sensor" in one[1] for one in server.state["actors"])
        assert server.bodies() == []


def test_a_place_that_is_taken_in_the_air(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    """A body in the air keeps CARLA from spawning anything there; the next height is free."""
    keys = {"simulation.duration_s": 0.1}
    frames = list(read_frames(drive(tmp_path / "free", scenario_file, server, **keys)))
    episode = server.state["episode"]
    for x_m, y_m in _places(tmp_path / "free" / "clean"):
        server.spawn("vehicle.standin.semi_trailer_0", x_m, -y_m, 25.0)
    again = list(read_frames(drive(tmp_path / "taken", scenario_file, server, **keys)))
    assert set(frames[0].boxes.ids) <= set(again[0].boxes.ids)
    assert server.state["episode"] == episode  # a map that is loaded already is kept, with others' actors


def _places(bag: Path) -> list[tuple[float, float]]:
    """Where some road users of a drive begin."""
    (_, message), *_ = BagReader(bag).messages("/v2x/stations")
    return [(one.pose.position.x, one.pose.position.y) for one in message.stations][::6]


def test_an_actor_of_carla_needs_its_world(scenario_file: Path) -> None:
    with pytest.raises(AdvpipeError, match=r"vehicles\.ego\.driver is carla, but world is raycast"):
        load_scenario(scenario_file, {"vehicles.ego.driver": "carla"})
