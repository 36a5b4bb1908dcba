"""A small world, rays as a LiDAR sends them, and a hilly road network with a bridge."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.road_network.file import sumo_program
from advpipe.stages.simulate.road_network.network import RoadNetwork, load_network
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

NODES = """<nodes>
 <node id="a" x="0" y="0" z="0"/><node id="b" x="200" y="0" z="12"/><node id="c" x="400" y="0" z="12"/>
 <node id="d" x="600" y="0" z="0"/><node id="n" x="200" y="150" z="4"/>
 <node id="s" x="300" y="-150" z="3"/><node id="t" x="300" y="150" z="3"/>
</nodes>"""
EDGES = """<edges>
 <edge id="ab" from="a" to="b" numLanes="2" speed="13.9"/>
 <edge id="bc" from="b" to="c" numLanes="2" speed="25"/>
 <edge id="cd" from="c" to="d" numLanes="2" speed="25"/>
 <edge id="bn" from="b" to="n" numLanes="1" speed="13.9"/>
 <edge id="st" from="s" to="t" numLanes="1" speed="13.9"/>
</edges>"""


@dataclass(frozen=True)
class Place:
    """A world with all that it was made from."""

    scenario: Scenario
    network: RoadNetwork
    variants: dict[str, Variant]
    world: RaycastWorld


def build(scratch: Path, *settings: str) -> Place:
    scenario = load_scenario("smoke", list(settings))
    network = load_network(scenario.map, scratch)
    variants = draw_variants(np.random.default_rng(0), scenario.bodies)
    return Place(scenario, network, variants, RaycastWorld(scenario, network, variants))


@pytest.fixture(scope="session")
def boulevard(tmp_path_factory: pytest.TempPathFactory) -> Place:
    return build(tmp_path_factory.mktemp("boulevard"), "traffic.parked_per_km=60")


@pytest.fixture(scope="session")
def hill(tmp_path_factory: pytest.TempPathFactory) -> Place:
    """A road over a hill; where it is level, on 12 m, it spans another one at 3 m."""
    folder = tmp_path_factory.mktemp("hill")
    (folder / "n.nod.xml").write_text(NODES)
    (folder / "e.edg.xml").write_text(EDGES)
    out = folder / "hill.net.xml"
    command = [sumo_program("netconvert"), "-n", folder / "n.nod.xml", "-e", folder / "e.edg.xml", "-o", out]
    subprocess.run(command, check=True, capture_output=True)
    return build(folder, f"map.sumo_net={out}")


@pytest.fixture(scope="session")
def sweep() -> Callable[[np.ndarray], np.ndarray]:
    """Rays (R, 6) of a turn around a place, 24 channels from -20 to 3 degrees."""

    def rays(origin_m: np.ndarray, columns: int = 720) -> np.ndarray:
        elevation = np.deg2rad(np.linspace(-20, 3, 24))
        azimuth = 2 * np.pi * np.arange(columns) / columns
        across = np.cos(elevation)
        directions = np.stack(
            [
                np.cos(azimuth)[:, None] * across,
                np.sin(azimuth)[:, None] * across,
                np.broadcast_to(np.sin(elevation), (columns, 24)),
            ],
            axis=-1,
        ).reshape(-1, 3)
        origins = np.broadcast_to(np.asarray(origin_m), directions.shape)
        return np.concatenate([origins, directions], axis=1).astype(np.float32)

    return rays


@pytest.fixture(scope="session")
def users() -> Callable[[Place, int], list[RoadUser]]:
    """Road users of every body, strewn around the middle of the longest road, some behind others."""

    def strew(place: Place, count: int) -> list[RoadUser]:
        rng = np.random.default_rng(1)
        middle_m = longest_lane_middle(place.network)
        names = list(place.variants)
        found: list[RoadUser] = []
        while len(found) < count:
            offset = rng.uniform(-70, 70, 2) * (1, 0.35)
            variant = place.variants[names[(7 * len(found)) % len(names)]]
            pose = se3_from_yaw(middle_m + (*offset, 0.02), rng.uniform(0, 6.28), rng.normal(0, 0.03))
            room_m = [(variant.length_m + user.variant.length_m) / 2 for user in found]
            apart = [np.linalg.norm(pose[:3, 3] - user.position_m) for user in found]
            if np.linalg.norm(offset) > 9 and all(a > r for a, r in zip(apart, room_m, strict=True)):
                found.append(RoadUser(f"user.{len(found)}", variant, pose, np.zeros(3)))
        return found

    return strew


def longest_lane_middle(network: RoadNetwork) -> np.ndarray:
    edge = max(network.drivable, key=lambda edge: (len(edge.lanes), edge.length_m, edge.id))
    centre = edge.lanes[0].centre_m
    return (centre[len(centre) // 2 - 1] + centre[len(centre) // 2]) / 2


@pytest.fixture(scope="session")
def middle_m(boulevard: Place) -> np.ndarray:
    return longest_lane_middle(boulevard.network)
