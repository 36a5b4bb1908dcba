"""Stations' own states: an on-board estimate, or the truth with a slowly drifting error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, wrap_angle
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.v2x.facilities.own_state import STANDING_MPS, Accuracy
from advpipe.pipeline.v2x.section import SelfKnowledge
from advpipe.stages.simulate.traffic.road_users import RoadUser

POSITION_TIME_S = 30.0
HEADING_TIME_S = 10.0
SPEED_TIME_S = 5.0
"""Correlation times. White errors at 10 Hz would look like dynamics, trigger CAMs and make
their path history useless; the errors of real receivers drift slowly."""

_BLOCK = 64


class GaussMarkovErrors:
    """First-order Gauss-Markov errors of one station: east, north, heading, speed."""

    def __init__(self, knowledge: SelfKnowledge, step_s: float, rng: np.random.Generator) -> None:
        position_m, heading_rad = knowledge.position_stddev_m, math.radians(knowledge.heading_stddev_deg)
        stddev = (position_m, position_m, heading_rad, knowledge.speed_stddev_mps)
        times_s = (POSITION_TIME_S, POSITION_TIME_S, HEADING_TIME_S, SPEED_TIME_S)
        correlations = tuple(math.exp(-step_s / time_s) for time_s in times_s)
        noise_stddevs = tuple(math.sqrt(1 - m * m) * s for m, s in zip(correlations, stddev, strict=True))
        self._correlations, self._noise_stddevs = correlations, noise_stddevs
        self._draws = _draws(rng)
        self._errors = tuple(s * draw for s, draw in zip(stddev, next(self._draws), strict=True))

    def step(self) -> tuple[float, ...]:
        """Advance by one step; return errors east and north in m, of heading in rad, of speed in m/s."""
        self._errors = tuple(
            correlation * error + noise_stddev * draw
            for correlation, error, noise_stddev, draw in zip(
                self._correlations, self._errors, self._noise_stddevs, next(self._draws), strict=True
            )
        )
        return self._errors


def _draws(rng: np.random.Generator) -> Iterator[list[float]]:
    while True:
        yield from rng.standard_normal((_BLOCK, 4)).tolist()


def accuracy_of_receiver(knowledge: SelfKnowledge) -> Accuracy:
    """The accuracy of a station without an on-board filter."""
    variance_m2 = knowledge.position_stddev_m**2
    heading_rad = math.radians(knowledge.heading_stddev_deg)
    return Accuracy((variance_m2, 0.0, variance_m2), None, heading_rad, knowledge.speed_stddev_mps, None)


class SelfEstimates(NamedTuple):
    """The own estimates of S stations.

    map_SE3_base: (S, 4, 4). speed_mps: (S,), negative backwards. acceleration_mps2: (S,), forward.
    yaw_rate_radps: (S,), positive to the left.
    """

    map_SE3_base: Float64
    speed_mps: Float64
    acceleration_mps2: Float64
    yaw_rate_radps: Float64


class ReceiverErrors:
    """One station's receiver errors, and its yaw and speed at the previous step."""

    def __init__(self, knowledge: SelfKnowledge, step_s: float, rng: np.random.Generator) -> None:
        self.position_errors = GaussMarkovErrors(knowledge, step_s, rng)
        self.before: tuple[float, float] | None = None


def self_estimates(
    users: Sequence[RoadUser],
    errors: Sequence[ReceiverErrors],
    estimates: Mapping[str, Estimate],
    step_s: float,
) -> SelfEstimates:
    """The own estimates of stations: `estimates` by vehicle name where given, else the truth with errors.

    Acceleration and yaw rate come from separate instruments and not from positions, so they have
    no error. A standing vehicle knows that it stands, and errors do not reverse the direction of motion.
    """
    poses: Float64 = np.array([user.map_SE3_base for user in users])
    yaw_rad = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    smooth_mps: Float64 = np.einsum(
        "si,si->s", poses[:, :3, 0], np.array([user.velocity_mps for user in users])
    )
    east_m, north_m, turn_rad, error_mps = np.array([each.position_errors.step() for each in errors]).T
    speed_mps = _with_error(smooth_mps, error_mps)
    _turn(poses, turn_rad)
    poses[:, 0, 3] += east_m
    poses[:, 1, 3] += north_m
    estimated = [(index, estimates[user.id]) for index, user in enumerate(users) if user.id in estimates]
    for index, estimate in estimated:
        poses[index] = estimate.map_SE3_base
        speed_mps[index] = smooth_mps[index] = estimate.base_velocity_mps[0]
    now = list(zip(yaw_rad.tolist(), smooth_mps.tolist(), strict=True))
    before = np.array([each.before or at for each, at in zip(errors, now, strict=True)])
    for each, at in zip(errors, now, strict=True):
        each.before = at
    yaw_rate_radps = wrap_angle(yaw_rad - before[:, 0]) / step_s
    for index, estimate in estimated:
        yaw_rate_radps[index] = estimate.base_turn_rate_radps[2]
    return SelfEstimates(poses, speed_mps, (smooth_mps - before[:, 1]) / step_s, yaw_rate_radps)


def _with_error(true_mps: Float64, error_mps: Float64) -> Float64:
    measured_mps = true_mps + error_mps
    speed_mps = np.where(true_mps >= 0, np.maximum(measured_mps, 0.0), np.minimum(measured_mps, 0.0))
    return np.where(np.abs(true_mps) < STANDING_MPS, 0.0, speed_mps)


def _turn(map_SE3_base: Float64, turn_rad: Float64) -> None:
    """Rotate poses (S, 4, 4) in place about the map's vertical axis."""
    x_axes, y_axes = map_SE3_base[:, 0, :3].copy(), map_SE3_base[:, 1, :3].copy()
    cosine, sine = np.cos(turn_rad)[:, None], np.sin(turn_rad)[:, None]
    map_SE3_base[:, 0, :3] = cosine * x_axes - sine * y_axes
    map_SE3_base[:, 1, :3] = sine * x_axes + cosine * y_axes
