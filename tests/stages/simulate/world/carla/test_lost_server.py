"""A CARLA server that is not there, is lost, or is left in the middle of a drive."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

pytestmark = pytest.mark.oracle

COMMAND = [sys.executable, "-c", "from advpipe.__main__ import main; main()"]


@pytest.mark.nightly  # starts a server and a command for each
@pytest.mark.parametrize("fault", ["die_after", "silent_after"])
def test_a_server_that_is_lost_costs_one_line(
    fault: str, start_server: Any, scenario_file: Path, tmp_path: Path
) -> None:
    server = start_server(**{fault: 12})
    settings = ["world=carla", f"carla.server={server.address}", "carla.timeout_s=1.5"]
    command = [*COMMAND, "simulate", str(scenario_file), "--out", str(tmp_path / "out"), "--quiet"]
    for setting in (*settings, "simulation.duration_s=2"):
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    lines = done.stderr.strip().splitlines()
    assert done.returncode == 1, done
    assert "does not respond within 1.5 s" in lines[-1]
    assert len(lines) == 1, lines
    assert not (tmp_path / "out").exists()


def test_nothing_listens(scenario_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("carla")
    keys = {"world": "carla", "carla.server": "127.0.0.1:9"}
    with pytest.raises(AdvpipeError, match=r"no CARLA server at 127\.0\.0\.1:9 \(Connection refused\)"):
        simulate(load_scenario(scenario_file, keys), tmp_path / "out")


@pytest.mark.nightly
def test_ctrl_c_leaves_the_server_as_it_was(server: Any, scenario_file: Path, tmp_path: Path) -> None:
    command = [*COMMAND, "simulate", str(scenario_file), "--out", str(tmp_path / "out"), "--quiet"]
    for setting in ("world=carla", f"carla.server={server.address}", "simulation.duration_s=300"):
        command += ["--set", setting]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        until_s = time.monotonic() + 100
        while not any("lidar" in one[1] for one in server.state["actors"]):
            assert time.monotonic() < until_s
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert server.state["synchronous"] is False
    assert server.bodies() == []
    assert not any("sensor" in one[1] for one in server.state["actors"])
    assert not (tmp_path / "out").exists()
