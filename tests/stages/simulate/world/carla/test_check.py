"""`advpipe check carla`, against the stand-in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.carla import Carla
from advpipe.stages.simulate.run import simulate

pytestmark = pytest.mark.oracle


@pytest.fixture
def loaded(server: Any, scenario_file: Path, tmp_path: Path) -> Any:
    """A server with the generated map, and two vehicles of another client's."""
    keys = {"world": "carla", "carla.server": server.address, "carla.timeout_s": 60}
    keys["simulation.duration_s"] = 0.1
    simulate(load_scenario(scenario_file, keys), tmp_path / "drive")
    return server


def findings_of(server: Any) -> dict[str, tuple[bool, str]]:
    from advpipe.stages.simulate.world.carla.check import CarlaCheck

    found = CarlaCheck(Carla(server=server.address, timeout_s=60)).run()
    return {one.name: (one.is_good, one.seen) for one in found}


def test_a_good_server(loaded: Any) -> None:
    found = findings_of(loaded)
    assert len(found) == 15
    assert all(is_good for is_good, _ in found.values()), found
    assert "0.0 mm from its place one tick after a move" in found["mirrored vehicles"][1]
    assert "at y = -7" in found["LiDAR's axes and ids"][1]  # to the right
    assert "positive ones move away" in found["radar"][1]
    assert loaded.state["synchronous"] is False
    assert loaded.bodies() == []


@pytest.mark.nightly
def test_numbers_and_velocities_of_another_kind(loaded: Any) -> None:
    """Instance images with Unreal's numbers, as before 0.9.16, and a radar as its documentation has it."""
    loaded.faults(numbers=1000, rates=-1)
    found = findings_of(loaded)
    bad = {name: seen for name, (is_good, seen) in found.items() if not is_good}
    assert bad.keys() == {"cameras", "radar"}
    assert "0 pixels have the number of the vehicle to the right" in bad["cameras"]
    assert "positive ones come nearer, against what its source says" in bad["radar"]


def test_a_server_of_another_release(server: Any) -> None:
    server.faults(version="0.9.15")
    found = findings_of(server)
    assert list(found) == ["server", "asynchronous afterwards"]
    assert found["server"] == (
        False,
        f"the server at {server.address} is CARLA 0.9.15, but 0.9.16 is needed; start that release",
    )


@pytest.mark.nightly
def test_another_client_that_ticks(loaded: Any) -> None:
    loaded.faults(intruder_at=10)
    found = findings_of(loaded)
    assert found["synchronous mode"][0] is False
    assert "another client ticks" in found["synchronous mode"][1]
    assert found["asynchronous afterwards"][0]
    assert loaded.state["synchronous"] is False


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("carla")
    from advpipe.pipeline.cli.check import check_command

    answer = check_command("carla", "127.0.0.1:9")
    assert answer.exit_code == 1
    answer.show()
    assert "FAIL  server: no CARLA server at 127.0.0.1:9" in capsys.readouterr().out
    assert json.loads(json.dumps(answer.document))["checks"][0]["is_good"] is False
    with pytest.raises(UsageError, match="--server 'nowhere': write host:port"):
        check_command("carla", "nowhere")
    with pytest.raises(UsageError, match="simulator 'karla' is unknown; did you mean 'carla'"):
        check_command("karla")
