"""The stand-in for a CARLA server, which the genuine client connects to."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.sensors.lidar.imperfections import IDEAL

SCENARIO = """
name: small
simulation: {seed: 3, duration_s: 0.4, warmup_s: 3}
map: {generator: {kind: grid, size: 3, block_m: 90}}
traffic: {vehicles: 45, pedestrians: 12, parked_per_km: 0}
environment: {buildings: 0.3, trees_per_km: 10, poles_per_km: 10, clutter_per_km: 5}
sensors:
  lidars:
    lidar:
      {z_m: 2.6, channels: 16, points_per_second: 96000, upper_fov: 2, lower_fov: -14,
       dropoff_general_rate: 0, dropoff_zero_intensity: 0, noise_stddev: 0, imperfections: IDEAL}
""".replace("IDEAL", json.dumps(IDEAL.model_dump()))
"""The imperfections are the embedded world's; CARLA's LiDAR has none of them."""


class StandIn:
    """One server process. `call` makes a remote call, beside the client under test."""

    def __init__(self, scenario: Path, faults: dict[str, Any]) -> None:
        command = [sys.executable, str(Path(__file__).parent / "standin"), str(scenario), json.dumps(faults)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        first = self.process.stdout.readline().split()
        assert first[0] == "port", first
        self.port = int(first[1])
        self.address = f"127.0.0.1:{self.port}"

    def call(self, method: str, *arguments: Any) -> Any:
        import msgpack

        with socket.create_connection(("127.0.0.1", self.port), timeout=10) as connection:
            connection.sendall(msgpack.packb([0, 1, method, [[False], *arguments]]))
            unpacker = msgpack.Unpacker(raw=False, strict_map_key=False)
            for answer in iter(lambda: connection.recv(1 << 16), b""):
                unpacker.feed(answer)
                for _, _, error, result in unpacker:
                    assert error is None, error
                    return result
        raise AssertionError("no answer")

    def faults(self, **faults: Any) -> None:
        self.call("test_faults", faults)

    @property
    def state(self) -> dict[str, Any]:
        return self.call("test_state")[0][1]

    def bodies(self) -> list[str]:
        """The blueprints of all vehicles and pedestrians on the server."""
        return [one[1] for one in self.state["actors"] if one[1].startswith(("vehicle.", "walker."))]

    def spawn(self, blueprint: str, x: float, y: float, z: float, role_name: str = "agent") -> int:
        """An actor of another client."""
        description = [1, blueprint, [["role_name", 4, role_name], ["base_type", 4, "car"]]]
        (found,) = self.call("spawn_actor", description, [[x, y, z], [0.0, 0.0, 0.0]])
        return found[1][0]

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="session")
def scenario_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("carla") / "small.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def start_server(
    scenario_file: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., StandIn]]:
    """Starts a server with given faults; ends it with the session."""
    pytest.importorskip("carla")
    pytest.importorskip("msgpack")
    servers = []

    def start(**faults: Any) -> StandIn:
        servers.append(StandIn(scenario_file, faults))
        return servers[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CARLA_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield start
    for server in servers:
        server.close()


@pytest.fixture(scope="session")
def shared_server(start_server: Callable[..., StandIn]) -> StandIn:
    return start_server()


@pytest.fixture
def server(shared_server: StandIn) -> Iterator[StandIn]:
    """A server without faults or actors of others; afterwards, it has to be asynchronous and empty again."""
    shared_server.faults()
    yield shared_server
    shared_server.faults()
    for number, blueprint, _ in shared_server.state["actors"]:
        if blueprint.startswith(("vehicle.", "walker.")):
            shared_server.call("destroy_actor", number)


SIGHT = {
    "sensors.cameras": {
        "front": {
            "image_size_x": 320,
            "image_size_y": 180,
            "fov": 80,
            "z_m": 2.4,
            "range": 300,
            "images": ["rgb", "depth", "semantic_segmentation", "instance_segmentation"],
            "noise": 0,
            "exposure_speed": 1,
        },
        "left": {
            "image_size_x": 96,
            "image_size_y": 64,
            "yaw_deg": 80,
            "pitch_deg": 10,
            "z_m": 2.4,
            "sensor_tick": 0.2,
            "shutter_speed": 500,
            "iso": 200,
            "exposure_compensation": 0.5,
            "motion_blur_intensity": 0.25,
        },
    },
    "sensors.radars": {
        "radar": {
            "horizontal_fov": 70,
            "vertical_fov": 12,
            "points_per_second": 20000,
            "range": 90,
            "elevation_resolution_deg": 2,
            "max_returns": 1500,
        }
    },
    "simulation.duration_s": 0.3,
}
"""Two cameras and a radar, of which the embedded world's pictures have no noise either."""


@pytest.fixture
def sight_settings() -> dict[str, Any]:
    """The settings of `sight`."""
    return SIGHT


@pytest.fixture(scope="session")
def sight(
    shared_server: StandIn, scenario_file: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path, dict[str, Any]]:
    """A drive with cameras and a radar through CARLA and in the embedded world, and the server's state."""
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.simulate.run import simulate

    folder = tmp_path_factory.mktemp("sight")
    keys = {**SIGHT, "world": "carla", "carla.server": shared_server.address, "carla.timeout_s": 60}
    simulate(load_scenario(scenario_file, keys), folder / "carla")
    state = shared_server.state
    simulate(load_scenario(scenario_file, SIGHT), folder / "embedded")
    return folder / "carla" / "clean", folder / "embedded" / "clean", state
