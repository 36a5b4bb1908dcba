"""A consistent sequence of one station's messages, and what it predicts for the next one."""

from __future__ import annotations

import math
from collections import deque
from itertools import islice
from typing import NamedTuple

from advpipe.pipeline.misbehaviour import checks
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.misbehaviour.config import DetectorConfig, Expectation
from advpipe.pipeline.misbehaviour.kalman import Kalman

_KALMAN_POSITION_M, _KALMAN_SPEED_MPS = 0.2, 0.15
_MOST_TURNING_MPS2 = 8.0  # beyond, tyres slip


class _TrackPoint(NamedTuple):
    """A message, and the sums of all claims up to it: displacement [m] and change of speed [m/s].

    span_s, bend_m: the time since the message before it, and `checks.unmodelled_m` in it.
    """

    claim: Claim
    x_m: float = 0.0
    y_m: float = 0.0
    faster_mps: float = 0.0
    span_s: float = 0.0
    bend_m: float = 0.0

    def extended(self, claim: Claim, expected: Expectation) -> _TrackPoint:
        x_m, y_m = checks.claimed_displacement_m(claim, self.claim)
        mean_mps2 = (self.claim.acceleration_mps2 + claim.acceleration_mps2) / 2
        span_s = checks.elapsed_s(claim, self.claim)
        return _TrackPoint(
            claim,
            self.x_m + x_m,
            self.y_m + y_m,
            self.faster_mps + mean_mps2 * span_s,
            span_s,
            checks.unmodelled_m(claim, self.claim, expected),
        )


class Track:
    """The messages of the last `window_s`, and a filter of all of them.

    last, length: the newest claim, and how many messages are in the window; there are none before the first
    `add`. last_fault_ns: when a check last failed. pardon_s: how long its messages have to be consistent
    after that for the station to be trusted.
    """

    def __init__(self, config: DetectorConfig) -> None:
        self._config = config
        self._window_s = config.window_s
        self._points: deque[_TrackPoint] = deque()
        self._next: _TrackPoint | None = None
        self.last: Claim
        self.length = 0
        self._kalman = Kalman(config.kalman_acceleration_mps2, _KALMAN_POSITION_M, _KALMAN_SPEED_MPS)
        self.last_fault_ns, self.pardon_s = 0, 0.0

    def add(self, claim: Claim) -> None:
        """Append this message; the filter is updated with the claim it evaluated last."""
        if not self._points:
            self.innovation(claim)
        self._kalman.accept()
        self._points.append(self._extended(claim) if self._points else _TrackPoint(claim))
        while len(self._points) > 2 and checks.elapsed_s(claim, self._points[1].claim) >= self._window_s:
            self._points.popleft()
        self.last, self.length = claim, len(self._points)

    def drift(self, claim: Claim, config: DetectorConfig) -> float:
        """The displacement since the first message in the window, against all claimed speeds and headings
        since."""
        if not self._reaches(claim):
            return math.nan
        first, now = self._points[0], self._extended(claim)
        miss_m = math.hypot(
            claim.x_m - first.claim.x_m - (now.x_m - first.x_m),
            claim.y_m - first.claim.y_m - (now.y_m - first.y_m),
        )
        # The unmodelled motion of each step adds up; errors of positions and speeds grow with time.
        bends_m = [*(point.bend_m for point in islice(self._points, 1, None)), now.bend_m]
        elapsed_s = checks.elapsed_s(claim, first.claim)
        return miss_m / checks.displacement_sigma_m(elapsed_s, config.expectation, *bends_m)

    def impulse(self, claim: Claim, config: DetectorConfig) -> float:
        """The change of speed since the first message in the window, against all claimed accelerations
        since."""
        if not self._reaches(claim):
            return math.nan
        first, now, expected = self._points[0], self._extended(claim), config.expectation
        changed_mps = claim.speed_mps - first.claim.speed_mps
        miss_mps = abs(changed_mps - (now.faster_mps - first.faster_mps))
        spans_s = [*(point.span_s for point in islice(self._points, 1, None)), now.span_s]
        noises_mps = [expected.acceleration_noise_mps2 * span_s for span_s in spans_s]
        wander_mps = expected.speed_mps_per_root_s * math.sqrt(abs(sum(spans_s)))
        return miss_mps / math.hypot(expected.speed_mps, wander_mps, *noises_mps)

    def innovation(self, claim: Claim) -> float:
        """The filter's normalised innovation squared; NaN where a message states no velocity."""
        velocity = checks.velocity_mps(claim)
        if not math.isfinite(velocity[0] + claim.x_m):
            return math.nan
        place, elapsed_s, turning_mps2, swing_m = (claim.x_m, claim.y_m), 0.0, 0.0, 0.0
        if self._points:
            elapsed_s = checks.elapsed_s(claim, self.last)
            turned_rad = math.remainder(claim.yaw_rad - self.last.yaw_rad, math.tau)
            turning_mps2 = min(abs(claim.speed_mps * turned_rad / elapsed_s), _MOST_TURNING_MPS2)
            swing_m = checks.swing_m(claim, self.last, self._config.expectation)
        return self._kalman.innovation(elapsed_s, place, velocity, turning_mps2, swing_m)

    def _reaches(self, claim: Claim) -> bool:
        """Whether the window holds two messages or more, none of them too old."""
        return self.length >= 2 and checks.elapsed_s(claim, self._points[0].claim) <= 2 * self._window_s

    def _extended(self, claim: Claim) -> _TrackPoint:
        """The point of this claim after the newest one; each check of a claim asks for it."""
        if self._next is None or self._next.claim is not claim:
            self._next = self._points[-1].extended(claim, self._config.expectation)
        return self._next
