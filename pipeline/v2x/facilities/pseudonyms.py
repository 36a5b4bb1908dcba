"""When a station changes its pseudonym: by period, by distance, or by a strategy of ETSI TR 103 415."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import PseudonymRules


class _Policy(Protocol):
    """Decides that a change is due; `start` is called with the first state of each pseudonym."""

    def start(self, state: StationState, share: float) -> None:
        """share: of the usual use of a pseudonym, in (0, 1 + variation]."""
        ...

    def is_due(self, state: StationState) -> bool: ...


class _ByPeriod:
    def __init__(self, rules: PseudonymRules) -> None:
        self._period_ns = rules.period_s * 1e9
        self._until_ns = 0.0

    def start(self, state: StationState, share: float) -> None:
        self._until_ns = state.time_ns + share * self._period_ns

    def is_due(self, state: StationState) -> bool:
        return state.time_ns >= self._until_ns


class _ByDistance:
    def __init__(self, rules: PseudonymRules) -> None:
        self._distance_m = rules.distance_m
        self._left_m = math.inf
        self._last: StationState | None = None

    def start(self, state: StationState, share: float) -> None:
        self._left_m, self._last = share * self._distance_m, state

    def is_due(self, state: StationState) -> bool:
        if self._last is not None:
            place = self._last.latitude_deg, self._last.longitude_deg
            self._left_m -= math.hypot(*east_north_m(*place, state.latitude_deg, state.longitude_deg))
        self._last = state
        return self._left_m <= 0


class _ByManoeuvre:
    """The first change of heading or speed after the period: the vehicle decides by its own motion."""

    def __init__(self, rules: PseudonymRules) -> None:
        self._heading_rad, self._speed_mps = math.radians(rules.heading_deg), rules.speed_mps
        self._period = _ByPeriod(rules)
        self._before: StationState | None = None

    def start(self, state: StationState, share: float) -> None:
        self._period.start(state, share)
        self._before = None

    def is_due(self, state: StationState) -> bool:
        if not self._period.is_due(state):
            return False
        if self._before is None:
            self._before = state
        turned_rad = abs(math.remainder(state.heading_rad - self._before.heading_rad, math.tau))
        faster_mps = abs(state.speed_mps - self._before.speed_mps)
        return turned_rad >= self._heading_rad or faster_mps >= self._speed_mps


_POLICIES: dict[str, Callable[[PseudonymRules], _Policy]] = {
    "period": _ByPeriod,
    "distance": _ByDistance,
    "silent_period": _ByPeriod,
    "vehicle_centric": _ByManoeuvre,
}


class PseudonymChanger:
    """The identity of one station over time. rng: of this station alone.

    The first pseudonym has been in use for a while when the station appears.
    """

    def __init__(self, rules: PseudonymRules, rng: np.random.Generator) -> None:
        self._rules, self._rng = rules, rng
        self._policy = _POLICIES[rules.strategy](rules)
        self._is_silent_strategy = rules.strategy == "silent_period"
        self._silent_until_ns: int | None = None
        self._is_started = False

    @property
    def is_silent(self) -> bool:
        """Whether the station sends nothing, before it takes its next pseudonym."""
        return self._silent_until_ns is not None

    def update(self, state: StationState, is_locked: bool) -> bool:
        """Take in the station's state; returns whether it takes another pseudonym now.

        is_locked: an application needs the present one: no change begins, and a silence is over.
        """
        if not self._is_started:
            self._is_started = True
            self._policy.start(state, float(self._rng.uniform(0, 1)))
            return False
        if self._silent_until_ns is not None:
            if state.time_ns < self._silent_until_ns and not is_locked:
                return False
            self._silent_until_ns = None
        elif is_locked or not self._policy.is_due(state):
            return False
        elif self._is_silent_strategy:
            silent_s = self._rng.uniform(self._rules.silent_min_s, self._rules.silent_max_s)
            self._silent_until_ns = state.time_ns + round(float(silent_s) * 1e9)
            return False
        variation = self._rules.variation
        self._policy.start(state, float(self._rng.uniform(1 - variation, 1 + variation)))
        return True
