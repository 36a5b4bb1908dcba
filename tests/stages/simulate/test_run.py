"""Stage 1 end to end on the smoke scenario: what is recorded is true, repeatable, and whole or absent."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from first_words import without_progress

from advpipe.pipeline.bag.frames import Frame, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import CLASSES, count_points
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.build import se3_from_pose
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

SMOKE = "from advpipe.pipeline.cli import app; app()"
DENSE = [
    "traffic.vehicles=120",
    "traffic.parked_per_km=60",
    "traffic.pedestrians=150",
    "simulation.warmup_s=10",
]


def run_smoke(out: Path, hash_seed: str = "0", *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", SMOKE, "simulate", "smoke", "--out", str(out), *more]
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    pipe = subprocess.PIPE

    def hear_ctrl_c() -> None:  # a shell's background job hands down a deaf ear
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    return subprocess.Popen(
        command, env=environment, stdout=pipe, stderr=pipe, text=True, preexec_fn=hear_ctrl_c
    )


@pytest.fixture(scope="module")
def dense(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive through dense traffic with the full sensor, without noise."""
    out = tmp_path_factory.mktemp("data") / "dense"
    exact = ("weak_noise_m", "beam_divergence_deg", "ring_elevation_stddev_deg", "ring_range_stddev_m")
    lidar = ["channels=64", "points_per_second=1152000", "noise_stddev=0"]
    lidar += [f"imperfections.{key}=0" for key in exact]
    simulate(load_scenario("smoke", [*DENSE, *(f"sensors.lidars.lidar.{key}" for key in lidar)]), out)
    return out / "clean"


@pytest.fixture(scope="module")
def frames(dense: Path) -> list[Frame]:
    return list(read_frames(dense))


def test_ten_frames_at_ten_hertz_from_the_scenarios_date(frames: list[Frame]) -> None:
    stamps = [frame.stamp_ns for frame in frames]
    assert stamps == [1767268800_000000000 + index * 100_000_000 for index in range(10)]


def test_boxes_hold_the_points_of_their_road_users(frames: list[Frame]) -> None:
    """A box that is grown all around holds hardly more points; one that is lifted holds none."""
    inside = beside = grown = 0
    for frame in frames:
        boxes, points = frame.boxes.geometry, xyz(frame.cloud)
        above = boxes + np.array([0, 0, 0.08, 0.01, 0.01, -0.16, 0])  # without the road below
        inside += count_points(points, above).sum()
        grown += count_points(points, above + np.array([0, 0, 0, 0.2, 0.2, 0, 0])).sum()
        beside += count_points(points, above + np.array([0, 0, 40.0, 0, 0, 0, 0])).sum()
    assert inside > 3000
    assert inside > 0.98 * grown
    assert beside < 0.01 * inside


def test_recorded_point_counts_are_those_of_the_cloud(dense: Path, frames: list[Frame]) -> None:
    recorded = [message for _, message in BagReader(dense).messages("/ego/ground_truth/road_users")]
    for frame, message in zip(frames, recorded, strict=True):
        assert [user.id for user in message.road_users] == list(frame.boxes.ids)
        assert [CLASSES.index(user.class_id) for user in message.road_users] == frame.boxes.labels.tolist()
        counts = count_points(xyz(frame.cloud), frame.boxes.geometry)
        # The map's frame and back moves a point by a rounding error: a few on a face may differ.
        assert np.abs(np.array([user.lidar_points for user in message.road_users]) - counts).max() <= 2


def test_every_class_of_road_user_occurs(frames: list[Frame]) -> None:
    seen = {CLASSES[label] for frame in frames for label in frame.boxes.labels}
    assert {"car", "truck", "pedestrian"} <= seen


def test_displacements_of_road_users_match_their_velocities(dense: Path) -> None:
    """In the map's frame; a vehicle that turns moves its middle a little more or less than its bumper."""
    messages = BagReader(dense).messages("/ego/ground_truth/road_users")
    recorded = [message.road_users for _, message in messages]
    errors_m = []
    for before, after in pairwise(recorded):
        places = {user.id: user.pose.position for user in before}
        for user in after:
            if user.id in places:
                old, new, speed = places[user.id], user.pose.position, user.velocity
                moved_m = np.array([new.x - old.x, new.y - old.y])
                errors_m.append(np.linalg.norm(moved_m - 0.1 * np.array([speed.x, speed.y])))
    assert np.median(errors_m) < 0.02
    assert np.quantile(errors_m, 0.98) < 0.3
    assert max(errors_m) < 1.0


def test_gnss_fixes_are_near_the_true_position(dense: Path) -> None:
    reader, geodesy = BagReader(dense), Geodesy(48.1351, 11.5820, 520.0)
    fixes = [message for _, message in reader.messages("/ego/gnss/fix")]
    truth = [message for _, message in reader.messages("/ego/ground_truth/odometry")]
    for fix, odometry in zip(fixes, truth, strict=True):
        place = geodesy.to_map([fix.latitude, fix.longitude, fix.altitude])
        error = place - se3_from_pose(odometry.pose.pose)[:3, 3]
        assert np.all(np.abs(error) < 6 * np.array([1.05, 1.05, 2.1]))


def test_same_seed_same_bytes_in_other_processes_and_hash_seeds(tmp_path: Path) -> None:
    digests = set()
    for hash_seed in ("1", "2"):
        out = tmp_path / f"run{hash_seed}" / "smoke"
        process = run_smoke(out, hash_seed)
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        digests.add(hashlib.sha256((out / "clean" / "clean_0.mcap").read_bytes()).hexdigest())
    assert len(digests) == 1
    other = tmp_path / "other"
    simulate(load_scenario("smoke", ["simulation.seed=2"]), other)
    assert hashlib.sha256((other / "clean" / "clean_0.mcap").read_bytes()).hexdigest() not in digests


def test_an_existing_output_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "mine"
    out.mkdir()
    (out / "precious.txt").write_text("keep")
    with pytest.raises(AdvpipeError, match="mine already exists; pass overwrite=True"):
        simulate(load_scenario("smoke"), out)
    simulate(load_scenario("smoke", ["simulation.duration_s=0.2"]), out, overwrite=True)
    assert (out / "precious.txt").read_text() == "keep"
    assert (out / "clean" / "metadata.yaml").is_file()


# cli/test_killed.py kills a simulation in every run.
@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.nightly)])
def test_an_interrupted_run_leaves_no_output(tmp_path: Path, how: signal.Signals) -> None:
    out = tmp_path / "stopped"
    process = run_smoke(out, "0", "--set", "simulation.duration_s=600")
    deadline = time.monotonic() + 60
    while not list(tmp_path.rglob("*.mcap")) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert list(tmp_path.rglob("*.mcap"))
    time.sleep(0.5)
    process.send_signal(how)
    _, errors = process.communicate()
    assert process.returncode != 0
    assert not out.exists()
    if how is signal.SIGINT:
        assert without_progress(errors).strip() == "advpipe: interrupted"
        assert not list(tmp_path.iterdir())
    simulate(load_scenario("smoke", ["simulation.duration_s=0.1"]), out)
    assert [path.name for path in tmp_path.iterdir()] == ["stopped"]


def test_a_missing_map_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="does not exist"):
        simulate(load_scenario("town06"), tmp_path / "out")
    assert not list(tmp_path.iterdir())
