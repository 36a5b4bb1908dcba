"""A second kind of sensor in one file and one registry line: simulated, shared, verified, never a LiDAR."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import find_lidar_topic, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate

SONAR, LIDAR = "/ego/front/returns", "/ego/roof/points"
SCENARIO = """
name: sonar
simulation: {duration_s: 0.5, warmup_s: 2}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 60, pedestrians: 5, parked_per_km: 60}
sensors:
  lidars: {roof: {channels: 8, points_per_second: 28800}}
  sonars: {front: {beams: 41}}
v2x: {enabled: false}
"""


def advpipe(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(Path(__file__).parent / "newcomer.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sonar")
    (folder / "sonar.yaml").write_text(SCENARIO, encoding="utf-8")
    done = advpipe("simulate", folder / "sonar.yaml", "--out", folder / "drive")
    assert done.returncode == 0, done.stderr
    return folder / "drive"


def test_it_is_configured_and_recorded(dataset: Path) -> None:
    reader = BagReader(dataset / "clean")
    assert reader.topics[SONAR].count == reader.topics[LIDAR].count == 5
    clouds = [reader.cloud(raw) for raw in reader.raw_messages([SONAR])]
    assert all(2 <= len(one.cloud) <= 41 for one in clouds)
    assert {one.frame_id for one in clouds} == {"ego/front"}
    static = {t.child_frame_id for _, m in reader.messages("/tf_static") for t in m.transforms}
    assert static == {"ego/imu", "ego/roof", "ego/front"}


def test_without_its_registry_line_the_scenario_refuses_it(dataset: Path) -> None:
    with pytest.raises(AdvpipeError, match=r"sensors\.sonars \(line \d+\): unknown key"):
        load_scenario(str(dataset / "scenario.yaml"))


def test_its_panel_is_in_the_layouts_and_the_drive_verifies(dataset: Path, tmp_path: Path) -> None:
    assert f"{dataset}: good\n" in advpipe("verify", dataset).stdout
    done = advpipe("share", dataset, "--out", tmp_path / "shared")
    assert done.returncode == 0, done.stderr
    foxglove = json.loads((tmp_path / "shared" / "play" / "foxglove.json").read_text(encoding="utf-8"))
    scene = foxglove["configById"]["3D!scene"]["topics"]
    assert scene[SONAR] == {"visible": True, "colorField": "intensity", "pointSize": 9}
    assert scene[LIDAR]["colorMap"] == "turbo"
    rviz = yaml.safe_load((tmp_path / "shared" / "play" / "scene.rviz").read_text(encoding="utf-8"))
    styles = {one["Name"]: one.get("Style") for one in rviz["Visualization Manager"]["Displays"]}
    assert (styles[SONAR], styles[LIDAR]) == ("Boxes", "Points")


def test_it_is_not_taken_for_a_lidar(dataset: Path, tmp_path: Path) -> None:
    """Not even a release that does not know it: both have topics of sensor_msgs/PointCloud2."""
    clean = dataset / "clean"
    reader = BagReader(clean)
    assert reader.topics[SONAR].type == reader.topics[LIDAR].type
    assert lidar_topics(reader) == [LIDAR]
    assert find_lidar_topic(reader) == LIDAR
    assert len(list(read_frames(clean))) == 5
    detach = AttackSpec(type="detach", recipe="random", parameters={"ratio": 0.5})
    attack(clean, tmp_path / "detached", AttackRequest((detach,)))
    attacked = BagReader(tmp_path / "detached")
    counts = [[len(bag.cloud(raw).cloud) for raw in bag.raw_messages([LIDAR])] for bag in (reader, attacked)]
    assert np.all(np.array(counts[1]) < 0.6 * np.array(counts[0]))
    of_sonar = [[raw.cdr for raw in bag.raw_messages([SONAR])] for bag in (reader, attacked)]
    assert of_sonar[0] == of_sonar[1]
    report = evaluate(clean, [], tmp_path / "report", Options(frames=FrameSlice(0, 1), bootstrap_draws=10))
    assert report.rows[0]["frames"] == 1


REFUSED = """
import sys
from advpipe.pipeline.sensors import registry
from newcomer import Sonars
registry.SENSORS["sonars"] = Sonars
from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario

dataset = sys.argv[1]
for refuse in (
    lambda: find_lidar_topic(BagReader(f"{dataset}/clean"), "/ego/front/returns"),
    lambda: load_scenario(f"{dataset}/scenario.yaml", ["sensors.sonars.front.vehicle=bus"]),
    lambda: load_scenario(f"{dataset}/scenario.yaml", ["sensors.sonars={roof: {}}"]),
    lambda: load_scenario(f"{dataset}/scenario.yaml", ["sensors.sonars.front.beams=0"]),
):
    try:
        refuse()
    except AdvpipeError as error:
        print(error)
"""


def test_errors_are_one_line(dataset: Path) -> None:
    command = [sys.executable, "-c", REFUSED, str(dataset)]
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    named, carrier, name, bounds = done.stdout.splitlines()
    assert f"the clouds of {SONAR} come from sensors.sonars, not from a LiDAR; it has {LIDAR}" in named
    assert "sensors.sonars.front.vehicle 'bus' is not one of the vehicles (ego)" in carrier
    assert "sonars.roof has the name of another sensor of its vehicle" in name
    assert "sensors.sonars.front.beams: Input should be greater than or equal to 1" in bounds
