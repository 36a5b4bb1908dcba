"""Traffic of a table alone: the same drive as SUMO's without other traffic."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import topics
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.road_users import RoadUser


def played(folder: Path, *settings: str) -> Scenario:
    """The ego and a bus that comes and goes, on the boulevard."""
    rows = "".join(f"ego,{t},{5 * t},-30,0,0,sedan\n" for t in range(3))
    rows += "".join(f"bus,{t},{20 - 5 * t},-26,0,3.14,bus\n" for t in (0.25, 0.65))
    (folder / "t.csv").write_text("id,time_s,x_m,y_m,z_m,yaw_rad,body\n" + rows)
    more = [f"trajectories.file={folder / 't.csv'}", "vehicles={ego: {driver: trajectory}}"]
    more += ["traffic.vehicles=0", "simulation.warmup_s=0", "environment.buildings=0"]
    return load_scenario("smoke", [*more, *settings])


def test_the_drive_equals_sumos_without_other_traffic(tmp_path: Path) -> None:
    bags = []
    for source in ("sumo", "trajectories"):
        simulate(played(tmp_path, f"traffic.source={source}"), tmp_path / source)
        messages = list(BagReader(tmp_path / source / "clean").raw_messages())
        bags.append([message for message in messages if message.topic.name != topics.SCENARIO_INFO.name])
    assert bags[0] == bags[1]
    assert len(bags[0]) > 50


def test_a_pushed_vehicle_exists_for_one_step(tmp_path: Path, variants: dict[str, Variant]) -> None:
    scenario = played(tmp_path, "traffic.source=trajectories")
    guest = RoadUser("guest", variants["suv.0"], se3_from_yaw([1, 2, 0], 0), np.zeros(3))
    network = load_network(scenario.map, tmp_path)
    seen = []
    with open_traffic(scenario, network, variants, tmp_path) as traffic:
        for frame in range(8):
            if frame == 2:
                traffic.push([guest])
            traffic.step()
            seen.append(set(traffic.road_users()))
    ego, bus = {"ego"}, {"ego", "bus"}
    assert seen == [ego, ego, ego | {"guest"}, bus, bus, bus, bus, ego]


def test_pushing_a_vehicle_of_the_table_replaces_it(tmp_path: Path, variants: dict[str, Variant]) -> None:
    scenario = played(tmp_path, "traffic.source=trajectories")
    aside = RoadUser(
        "ego", variants["sedan.0"], se3_from_yaw([1, 2, 0], 0), np.zeros(3), ExteriorLights.LOW_BEAM
    )
    network = load_network(scenario.map, tmp_path)
    with open_traffic(scenario, network, variants, tmp_path) as traffic:
        traffic.step()
        of_table = traffic.road_users()["ego"]
        traffic.push([aside], [aside])
        traffic.step()
        assert traffic.road_users() == {"ego": aside}
        traffic.step()
        back = traffic.road_users()["ego"]
    assert of_table.lights == back.lights == ExteriorLights.DAYTIME_RUNNING
    assert back.position_m[1] == of_table.position_m[1] == -30


def test_a_vehicle_with_another_driver_is_refused(tmp_path: Path) -> None:
    scenario = load_scenario("smoke", ["traffic.source=trajectories"])
    with pytest.raises(UsageError, match=r"vehicles\.ego\.driver is traffic, but .* set it to trajectory"):
        simulate(scenario, tmp_path / "out")
