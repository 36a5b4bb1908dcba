"""A spoofer fed by hand, and a short drive of two vehicles with V2X."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.attack.gnss.base import GnssAttack, SpoofingContext, TrueFix
from advpipe.stages.simulate.run import simulate

Follow = Callable[..., list[np.ndarray | None]]
PERIOD_NS = 100_000_000


@pytest.fixture
def follow() -> Follow:
    """The false fixes of an attack on genuine ones at 10 Hz, all in one span from fix `first` on."""

    def follow(
        attack: GnssAttack,
        positions_m: Sequence[Sequence[float]],
        *,
        heading_rad: float = 0.0,
        first: int = 0,
        innovations: Sequence[Innovation] = (),
        past_nis: Sequence[float] = (),
        seed: int = 1,
    ) -> list[np.ndarray | None]:
        spoof, spoofed = attack.begin(np.random.default_rng(seed)), []
        genuine = [TrueFix(k * PERIOD_NS, np.array(p, dtype=float)) for k, p in enumerate(positions_m)]
        for k in range(first, len(genuine)):
            interval_s = 0.1 if k > first else 0.0
            seen = (lambda now: lambda: innovations[now])(k)
            elapsed_s = 0.1 * (k - first)
            context = SpoofingContext(genuine[: k + 1], elapsed_s, interval_s, heading_rad, seen, past_nis)
            spoofed.append(spoof(context))
        return spoofed

    return follow


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> BagReader:
    """Eight seconds with `ego` and `other`, both instrumented, and V2X; next to no LiDAR."""
    out: Path = tmp_path_factory.mktemp("gnss") / "drive"
    settings = [
        "simulation.duration_s=8",
        "vehicles={ego: {}, other: {}}",
        "sensors.lidars.lidar.channels=2",
        "sensors.lidars.lidar.points_per_second=4000",
        "recording.markers=false",
    ]
    simulate(load_scenario("smoke", settings), out)
    return BagReader(out / "clean")
