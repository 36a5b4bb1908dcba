"""Who lies is named, from when and why; honest ones are not; nothing but the vehicle's evidence is read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_drive import (
    EGO,
    EVERYTHING,
    GHOST,
    LEADER,
    START_NS,
    STEP_NS,
    Lies,
    cam,
    cast,
    record_small_drive,
)

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import cloud_to_cdr
from advpipe.pipeline.messages.v2x import udp_packet_cdr
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.investigate.evidence_topics import find_evidence
from advpipe.stages.investigate.page import investigation_page
from advpipe.stages.investigate.run import investigate
from advpipe.stages.simulate.run import simulate

WITH_GHOST = Lies(ghost=True)


def test_nobody_is_named_in_an_honest_drive(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive"))
    assert found.suspects == ()
    assert found.watched == 3  # the leader, the GNSS and the LiDAR
    assert {"cam-plausibility", "free-space", "gnss-innovation", "gnss-motion", "lidar-rays"} <= set(
        found.judged
    )


def test_a_ghost_vehicle_is_named_for_the_rays_that_pass_through_it(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", WITH_GHOST))
    (one,) = found.suspects
    assert one.station_id == GHOST
    assert one.probability > 0.5
    assert one.start_s == pytest.approx(3.0, abs=0.3)
    assert one.episodes[0].alarm_s < 4.0
    row = next(row for row in one.episodes[0].evidence if row.cue == "free-space")
    assert "pass through the vehicle that it claims to be, 20 m away" in row.words
    assert one.picture is not None
    beyond_m = np.linalg.norm(one.picture.rays_m, axis=1)
    assert (beyond_m > np.linalg.norm(one.picture.corners_m, axis=1).min()).all()


def test_a_jump_of_the_fixes_names_the_gnss_and_no_station(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", Lies(jump_m=25.0)))
    assert [one.name for one in found.suspects] == ["GNSS"]
    assert found.suspects[0].start_s == pytest.approx(3.0, abs=0.3)


def test_points_off_the_rays_name_the_lidar(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", Lies(off_ray_m=0.05)))
    assert [one.name for one in found.suspects] == ["/ego/lidar/points"]
    assert found.suspects[0].start_s == pytest.approx(3.0, abs=0.3)


def test_holes_in_surfaces_name_the_lidar_until_they_end(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", Lies(removed=20)))
    (one,) = found.suspects
    assert one.name == "/ego/lidar/points"
    assert one.start_s == pytest.approx(3.0, abs=0.3)
    row = next(row for row in one.episodes[0].evidence if row.cue == "lidar-temporal")
    assert "vanish from the middle of bright surfaces" in row.words


def test_a_vehicle_that_vanishes_in_free_sight_names_the_lidar_and_not_its_station(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", Lies(hidden=True)))
    (one,) = found.suspects
    assert one.name == "/ego/lidar/points"
    assert one.start_s == pytest.approx(3.0, abs=0.3)
    row = next(row for row in one.episodes[0].evidence if row.cue == "lidar-tracks")
    assert f"no longer sees the vehicle of station {LEADER}" in row.words


def test_what_no_vehicle_knows_changes_no_byte_of_the_answer(tmp_path: Path) -> None:
    """A bag with truth, scenario and provenance, and the same without them."""
    stripped, whole = (
        json.dumps(
            investigate(record_small_drive(tmp_path / str(secrets), WITH_GHOST, secrets=secrets)).to_plain()
        )
        for secrets in (False, True)
    )
    assert stripped == whole
    assert str(GHOST) in whole


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clean bag of a drive of three seconds in which all send, by a LiDAR of two rings."""
    coarse = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")
    settings = (*coarse, "simulation.duration_s=3", "v2x.penetration=1")
    return simulate(load_scenario("smoke", settings), tmp_path_factory.mktemp("drives") / "drive").bag


def test_of_a_simulated_drive_only_what_the_vehicle_had_is_read(simulated: Path) -> None:
    read = find_evidence(BagReader(simulated)).kinds
    sensed = ("lidar/points", "gnss/fix", "wheel/odometry", "imu", "odometry", "initialpose")
    received = ("v2x/rx/raw", "v2x/rx/info")
    assert set(read) == {
        *(f"/ego/{name}" for name in (*sensed, *received)),
        *("/tf", "/tf_static", "/map/lanes"),
    }


def test_an_attacked_bag_without_what_no_vehicle_knows_gets_the_same_answer(
    simulated: Path, tmp_path: Path
) -> None:
    """Truth, true receptions, `/v2x/...`, scenario, provenance and labels are stripped from it."""
    spec = attack_spec({"type": "cam-position-random-offset", "schedule": {"from_s": 1.0}})
    attack(simulated, tmp_path / "attacked", AttackRequest((spec,)), workers=1)
    reader = BagReader(tmp_path / "attacked")
    allowed = find_evidence(reader).kinds
    with BagWriter(tmp_path / "stripped", provenance={}) as bag:
        for raw in reader.raw_messages(sorted(allowed)):
            bag.copy(raw)
    whole, stripped = (investigate(tmp_path / name).to_plain() for name in ("attacked", "stripped"))
    assert json.dumps(whole) == json.dumps(stripped)
    assert whole["watched"] > 2


@pytest.mark.parametrize(
    ("missing", "cue", "words"),
    [
        ({"cloud"}, "free-space", "the bag has no LiDAR clouds"),
        ({"messages"}, "cam-plausibility", "the bag has no received V2X messages"),
        ({"fix"}, "gnss-motion", "the bag has no GNSS fixes"),
        ({"imu", "initial"}, "gnss-innovation", "the bag has no IMU and no initial pose"),
        ({"lanes"}, "gnss-lanes", "the bag has no lanes"),
        ({"mount"}, "free-space", "the bag has no mounts of sensors"),
        ({"estimate"}, "free-space", "the bag has no vehicle's own pose"),
    ],
)
def test_without_a_topic_it_says_what_it_could_not_judge(
    tmp_path: Path, missing: set[str], cue: str, words: str
) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", only=EVERYTHING - missing, steps=15))
    assert words in found.not_judged[cue].replace("the vehicle's", "vehicle's")
    assert found.judged
    assert found.suspects == ()


def test_a_bag_of_received_messages_alone_is_judged(tmp_path: Path) -> None:
    """A station that stands still in its CAMs, and says that it drives at 10 m/s."""
    with BagWriter(tmp_path / "drive", provenance={}) as bag:
        for number in range(60):
            now_ns = START_NS + number * STEP_NS
            centre_m = (10.0 * min(number / 10, 3.0), 0.0)
            bag.write_cdr(EGO.received_raw, udp_packet_cdr(now_ns, cam(5, now_ns, centre_m)), now_ns)
            bag.write_cdr(EGO.received_raw, udp_packet_cdr(now_ns, b"no CAM at all"), now_ns)
    found = investigate(tmp_path / "drive")
    assert 5 in [one.station_id for one in found.suspects]
    one = next(one for one in found.suspects if one.station_id == 5)
    assert one.start_s == pytest.approx(3.1, abs=0.5)


@pytest.mark.parametrize(("silence_s", "stations"), [(None, 8), (0.0, 1)])
def test_a_new_pseudonym_is_the_station_whose_way_it_continues(
    tmp_path: Path, silence_s: float | None, stations: int
) -> None:
    """A car 20 m ahead changes its id every second; without links, each appears from nowhere."""
    with BagWriter(tmp_path / "drive", provenance={}) as bag:
        for number in range(80):
            now_ns, x_m = START_NS + number * STEP_NS, float(number)
            pose = se3_from_yaw([x_m, 0.0, 0.0], 0.0)
            message = build.odometry(
                now_ns,
                pose,
                (10.0, 0.0, 0.0),
                (0.0, 0.0, 0.0),
                frame_id="map",
                child_frame_id=EGO.base_frame,
                pose_covariance=np.eye(6) * 1e-4,
                twist_covariance=np.eye(6) * 1e-4,
            )
            bag.write(EGO.odometry, message, now_ns)
            one = cam(100 + number // 10, now_ns, (x_m + 20.0, 0.0))
            bag.write_cdr(EGO.received_raw, udp_packet_cdr(now_ns + 1_000_000, one), now_ns + 1_000_000)
    found = investigate(tmp_path / "drive", silence_s=silence_s)
    assert found.watched == stations
    assert bool(found.suspects) == (stations > 1)


def test_another_tools_clouds_are_judged_by_their_type(tmp_path: Path) -> None:
    topic = Topic("/velodyne_points", "sensor_msgs/msg/PointCloud2")
    with BagWriter(tmp_path / "drive", provenance={}) as bag:
        for number in range(40):
            cloud = cast()
            if number >= 20:
                cloud["z"][::50] += np.float32(0.05)
            now_ns = START_NS + number * STEP_NS
            bag.write_cdr(topic, cloud_to_cdr(cloud, now_ns, "velodyne"), now_ns)
    found = investigate(tmp_path / "drive")
    assert [one.name for one in found.suspects] == ["/velodyne_points"]
    assert found.suspects[0].start_s == pytest.approx(2.0, abs=0.2)


def test_nothing_to_judge_is_said_in_one_line(tmp_path: Path) -> None:
    bag = record_small_drive(tmp_path / "drive", only=frozenset({"lanes", "imu"}), steps=3)
    with pytest.raises(UsageError, match=r"^\S+ has nothing to judge: neither LiDAR clouds, nor GNSS fixes"):
        investigate(bag)


def test_an_unknown_vehicle_is_refused(tmp_path: Path) -> None:
    bag = record_small_drive(tmp_path / "drive", only=frozenset({"fix"}), steps=3)
    with pytest.raises(UsageError, match="has no vehicle 'other'; it has: ego"):
        investigate(bag, vehicle="other")


def test_the_page_shows_the_time_line_the_words_and_the_rays(tmp_path: Path) -> None:
    found = investigate(record_small_drive(tmp_path / "drive", WITH_GHOST))
    page = investigation_page(found, "<drive>")
    (one,) = found.suspects
    assert "Investigation of &lt;drive&gt;" in page
    assert page.count('class="lie"') == len(one.episodes)
    assert page.count('class="ray"') == len(one.picture.rays_m) > 5  # type: ignore[union-attr]
    assert all(row.words in page for row in one.episodes[0].evidence)
