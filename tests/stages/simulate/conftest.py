"""Networks and drives of SUMO's, for the tests of traffic."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.scenario import Scenario
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.road_network.file import sumo_program
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.road_users import RoadUser

Drive = list[dict[str, RoadUser]]


@pytest.fixture
def grid(tmp_path: Path) -> Callable[..., Path]:
    """Makes a grid network with the given options of netgenerate."""

    def generate(*options: str) -> Path:
        out = tmp_path / "grid.net.xml"
        command = [sumo_program("netgenerate"), "--grid", *options, "--output-file", str(out)]
        subprocess.run(command, check=True, capture_output=True)
        return out

    return generate


@pytest.fixture
def road(tmp_path: Path) -> Callable[..., Path]:
    """Makes a network of one straight one-way road a -> b along x, and a road b -> c beyond a junction."""

    def build(length_m: float, lanes: int = 1, rise_m: float = 0.0, light: bool = False) -> Path:
        kind = "traffic_light" if light else "priority"
        (tmp_path / "r.nod.xml").write_text(
            f'<nodes><node id="a" x="0" y="0" z="0"/><node id="b" x="{length_m}" y="0" z="{rise_m}" '
            f'type="{kind}"/><node id="c" x="{length_m + 200}" y="0" z="{rise_m}"/>'
            f'<node id="n" x="{length_m}" y="100" z="{rise_m}"/></nodes>'
        )
        edges = [("ab", "a", "b"), ("bc", "b", "c"), ("nb", "n", "b")]
        (tmp_path / "r.edg.xml").write_text(
            "<edges>"
            + "".join(
                f'<edge id="{name}" from="{start}" to="{end}" numLanes="{lanes}" speed="13.9"/>'
                for name, start, end in edges
            )
            + "</edges>"
        )
        out = tmp_path / "road.net.xml"
        command = [sumo_program("netconvert"), "-n", str(tmp_path / "r.nod.xml")]
        command += ["-e", str(tmp_path / "r.edg.xml"), "-o", str(out), "--tls.green.time", "20"]
        subprocess.run(command, check=True, capture_output=True)
        return out

    return build


@pytest.fixture(scope="session")
def variants() -> dict[str, Variant]:
    return draw_variants(np.random.default_rng(0))


@pytest.fixture
def drive(tmp_path: Path, variants: dict[str, Variant]) -> Callable[[Scenario, int], Drive]:
    """Runs the traffic of a scenario without a world around it: everybody after each step."""

    def run(scenario: Scenario, steps: int) -> Drive:
        network = load_network(scenario.map, tmp_path, scenario.simulation.seed)
        states = []
        with open_traffic(scenario, network, variants, tmp_path) as traffic:
            for _ in range(steps):
                traffic.step()
                states.append(dict(traffic.road_users()))
        return states

    return run
