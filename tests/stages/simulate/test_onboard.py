"""The on-board filter on SUMO's own traffic, whose vehicles slide, kink and jump as no real ones do."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.onboard import OnBoard
from advpipe.pipeline.localisation.rotations import rotation_vector
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.registry import open_traffic

STEPS = 250


@pytest.fixture(scope="module")
def squares(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Normalised squared errors (STEPS, 3) of position, yaw and fix, for every car that stays on the road."""
    scratch = tmp_path_factory.mktemp("scratch")
    scenario = load_scenario("smoke", ["traffic.vehicles=25", "simulation.warmup_s=15"])
    network, variants = load_network(scenario.map, scratch), draw_variants(np.random.default_rng(0))
    geodesy = Geodesy(48.0, 11.0, 0.0)
    boards: dict[str, OnBoard] = {}
    found: dict[str, list[list[float]]] = {}
    with open_traffic(scenario, network, variants, scratch) as traffic:
        for step in range(STEPS):
            traffic.step()
            users = traffic.road_users()
            if not boards:
                cars = [name for name, user in users.items() if user.variant.body.label == "car"][:10]
                boards = {name: OnBoard(name, scenario.sensors, geodesy, 0.1, 5) for name in cars}
                found = {name: [] for name in cars}
            for name in boards.keys() & users.keys():
                user = users[name]
                done = boards[name].step(step * 100_000_000, user.map_SE3_base, user.velocity_mps)
                estimate = done.estimate
                error = (user.map_SE3_base - estimate.map_SE3_base)[:3, 3]
                turn = rotation_vector(user.map_SE3_base[:3, :3] @ estimate.map_SE3_base[:3, :3].T)[2]
                covariance = estimate.pose_covariance
                assert estimate.innovation is not None
                found[name].append(
                    [
                        error @ np.linalg.solve(covariance[:3, :3], error),
                        turn**2 / covariance[5, 5],
                        estimate.innovation.nis,
                    ]
                )
    return {name: np.array(values) for name, values in found.items() if len(values) == STEPS}


def test_errors_fit_the_covariance(squares: dict[str, np.ndarray]) -> None:
    """Expected are 3, 1 and 3. Wide bounds: one drive is one sample, and slides are not Gaussian."""
    assert len(squares) >= 6
    position, yaw, fix = np.mean([values.mean(axis=0) for values in squares.values()], axis=0)
    assert 1.2 < position < 5.5
    assert 0.2 < yaw < 2.5
    assert 2.7 < fix < 3.3


def test_no_filter_diverges(squares: dict[str, np.ndarray]) -> None:
    assert max(values[-50:, 0].mean() for values in squares.values()) < 16.3  # chi-square, 3 degrees, 99.9 %
