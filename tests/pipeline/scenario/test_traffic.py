"""The sections `traffic`, `trajectories` and `vehicles`: allowed values, and keys that exclude each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario

BAD = {
    "traffic={routes: a.rou.xml, sumo_config: b.sumocfg}": r"at most one of routes and sumo_config",
    "vehicles={ego: {driver: autopilot}}": r"vehicles\.ego\.driver: .*'controller' or 'carla'",
    "vehicles={ego: {driver: trajectory}}": r"driver is trajectory, but there is no trajectories\.file",
    "vehicles={ego: {speed_mps: 0}}": r"vehicles\.ego\.speed_mps: .*equal to 0\.1",
    "vehicles={ego: {route: main_street}}": r"vehicles\.ego\.route: ",
    "traffic.vehicles=-1": r"traffic\.vehicles: .*greater than or equal to 0",
    "traffic.transport=smoke_signals": r"traffic\.transport: .*'libsumo' or 'traci'",
    "traffic.server.port=8813": r"server needs transport: traci; set it too",
    "traffic={transport: traci, server: {join: 'here:1', clients: 2}}": r"port and clients apply only",
    "traffic={transport: traci, server: {join: here}}": r"traffic\.server\.join: ",
    "trajectories={}": r"trajectories\.file: is missing",
}


@pytest.mark.parametrize(("override", "message"), BAD.items())
def test_errors_name_invalid_traffic(override: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario("smoke", [override])
    assert "\n" not in str(caught.value)


def test_files_are_found_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "own.rou.xml").write_text("<routes/>")
    (tmp_path / "t.csv").write_text("id\n")
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nmap: {sumo_net: boulevard.net.xml}\ntraffic: {routes: own.rou.xml}\n"
        "trajectories: {file: t.csv}\n"
    )
    scenario = load_scenario(str(tmp_path / "mine.yaml"))
    assert scenario.traffic.routes == str(tmp_path / "own.rou.xml")
    assert scenario.trajectories is not None
    assert scenario.trajectories.file == str(tmp_path / "t.csv")
