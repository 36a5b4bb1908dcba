"""The result of attacks on one attacker's messages, and short drives, recorded once for all tests."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.v2x.base import AllocatedIds, AttackContext
from advpipe.stages.attack.v2x.cams import CamEditor
from advpipe.stages.simulate.run import simulate

sys.path.insert(0, str(Path(__file__).parent))

from one_attacker import ATTACKER, OTHER, START_NS

COARSE = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")

AttackedCams = Callable[..., list[Cam]]


def _context(name: str, active: Callable[[int], bool], seed: int) -> AttackContext:
    return AttackContext(
        name=name,
        seed=seed,
        seed_name="",
        attackers=(ATTACKER,),
        victim=None,
        active=active,
        start_ns=START_NS,
        v2x=V2x(),
        geodesy=Geodesy(48.0, 11.0, 520.0),
        cams=CamEditor(),
        numbers=AllocatedIds(10_000, {ATTACKER, OTHER}),
    )


@pytest.fixture
def attacked_cams() -> AttackedCams:
    """The CAMs of attacker 7 after an attack, in steps of one second.

    Another station sends the same messages, which must not change.
    """

    def run(
        name: str, messages: Sequence[Sent], from_ms: int = 0, seed: int = 1, **parameters: Any
    ) -> list[Cam]:
        attack = find_attack(name)(
            _context(name, lambda time_ns: time_ns >= START_NS + from_ms * 1_000_000, seed), **parameters
        )
        radios = tuple(
            RadioPlace(station, str(station), np.eye(4), (4.5, 1.8, 1.5), np.zeros(3))
            for station in (ATTACKER, OTHER)
        )
        reported = []
        for begin_ms in range(0, 1 + max(one.request_ns - START_NS for one in messages) // 1_000_000, 1000):
            begin_ns = START_NS + begin_ms * 1_000_000
            end_ns = begin_ns + 1_000_000_000
            own = [one for one in messages if begin_ns <= one.request_ns < end_ns]
            others = [replace(one, station_id=OTHER, number=one.number + 100_000) for one in own]
            edited = attack.edit(V2xStep(begin_ns, end_ns, radios, (*own, *others)), (*own, *others))
            assert [one for one in edited if one.station_id == OTHER] == others
            reported += [decode_cam(one.payload) for one in edited if one.station_id == ATTACKER]
            same = [replace(one, payload=b"") for one in edited if one.station_id == ATTACKER]
            assert same == [replace(one, payload=b"") for one in own]
        return reported

    return run


Record = Callable[..., BagReader]


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Records the scenario `smoke` once per settings, with all vehicles equipped and a minimal LiDAR."""

    @cache
    def record(*settings: str) -> BagReader:
        out: Path = tmp_path_factory.mktemp("forged") / "drive"
        base = (*COARSE, "simulation.duration_s=3", "v2x.penetration=1")
        simulate(load_scenario("smoke", [*base, *settings]), out)
        return BagReader(out / "clean")

    return record
