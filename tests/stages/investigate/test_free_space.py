"""How much a claimed vehicle in free space says: of several clouds, and by how well the places are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.attack_detection.box_frustum import BoxFrustum
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.misbehaviour.roads import NO_ROADS
from advpipe.stages.investigate.cue import station
from advpipe.stages.investigate.cues.free_space import (
    CLOUDS,
    LEAST_ERROR_M,
    MOST_CLAIMED_M,
    FreeSpaceCue,
    _Candidate,
    _error_m,
)
from advpipe.stages.investigate.judged_scan import JudgedScan
from advpipe.stages.investigate.observations import LidarScan, Observations, ObservedPose
from advpipe.stages.investigate.sight import SeenBox
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

AWAY_M = 30.0
NONE = np.zeros(0)
SEEN = SeenBox(np.array([AWAY_M, 0, 0, 4, 2, 1, 0]), BoxFrustum(*[NONE] * 6), 3.0)


def least(values: list[float], step_s: float = 0.1) -> list[float]:
    """What a station's values in clouds one after the other count."""
    cue = FreeSpaceCue(PriorKnowledge(None, NO_ROADS, None))
    times_ns = [round(step * step_s * 1e9) for step in range(len(values))]
    scans = [JudgedScan("lidar", LidarScan("lidar", t, pytest.fail), None, None) for t in times_ns]
    return [cue._least(scan, 7, value) for scan, value in zip(scans, values, strict=True)]


def test_a_vehicle_that_some_clouds_see_is_not_accused() -> None:
    assert max(least([8.0, 8.0, 0.3, 8.0, 8.0, 0.2, 8.0])) < 0.5


def test_one_that_no_cloud_sees_is() -> None:
    assert least([8.0] * 5) == [0.0] * (CLOUDS - 1) + [8.0] * (5 - CLOUDS + 1)


def test_clouds_long_apart_do_not_confirm_each_other() -> None:
    assert max(least([8.0] * 5, step_s=5.0)) == 0.0


@pytest.mark.parametrize(
    ("place_m", "yaw_rad", "claimed_m", "expected_m"),
    [
        (0.0, 0.0, 0.0, LEAST_ERROR_M),
        (0.5, 0.0, 1.0, LEAST_ERROR_M),
        (3.0, 0.0, 0.0, 3.0),
        (0.0, 0.1, 0.0, 0.1 * AWAY_M),
        (0.0, 0.0, 500.0, MOST_CLAIMED_M),
        (3.0, 0.1, 1.6, math.hypot(3.0, 3.0, 0.8)),
    ],
)
def test_who_knows_its_own_place_badly_accuses_less(
    place_m: float, yaw_rad: float, claimed_m: float, expected_m: float
) -> None:
    pose = ObservedPose(0, np.eye(4), yaw_rad, place_m)
    claim = Claim(7, 0, 0, position_m=claimed_m)
    found = _error_m(_Candidate(station(7), "it", (), claim), SEEN, Situation(0, Observations(0), pose))
    assert found == pytest.approx(expected_m)
