"""The checks of the detector: what each measures, its threshold, and the source of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

from advpipe.pipeline.misbehaviour import tuned


class Check(NamedTuple):
    """One line of the table of checks.

    unit: of the statistic and its threshold; "sigma" is a residual over the standard deviation that the
    receiver expects (`Expectation`). rule: the threshold above which a message is flagged where that
    follows from a standard, None where it is tuned. margin: the factor by which a tuned threshold
    exceeds the statistic on clean drives. least: lower bound of a tuned threshold, as short drives show too
    little.
    """

    unit: str
    rule: float | None
    margin: float
    least: float
    meaning: str
    source: str

    @property
    def is_tuned(self) -> bool:
        """Whether the threshold was tuned, rather than taken from a rule."""
        return self.rule is None


def _ruled(unit: str, threshold: float, meaning: str, source: str) -> Check:
    return Check(unit, threshold, 1.0, threshold, meaning, source)


def _tuned(unit: str, margin: float, least: float, meaning: str, source: str) -> Check:
    return Check(unit, None, margin, least, meaning, source)


CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "decoding": _ruled("1", 0.5, "bytes that are not a CAM", "EN 302 637-2"),
        "format": _ruled("fields", 0.5, "fields missing or out of range", "TS 102 894-2"),
        "identity": _ruled("1", 0.5, "the receiver's own id, or a changed type", "EN 302 637-2"),
        "range": _tuned("m", 1.5, 1000.0, "distance from the receiver", "F2MD range"),
        "speed": _tuned("m/s", 1.2, 20.0, "speed", "F2MD speed"),
        "position": _tuned("m", 1.5, 1.5, "distance from the nearest lane", "F2MD position"),
        "wrong_way": _tuned("rad", 1.2, 0.6, "angle to the direction of every nearby lane", "F2MD, VASP"),
        "freshness": _tuned("s", 1.2, 0.2, "age on arrival, or time ahead", "Artery's LDM"),
        "frequency": _ruled("Hz", 12.5, "1 / time since the last CAM", "EN 302 637-2, 6.1.3"),
        "position_speed": _tuned("sigma", 1.1, 3.5, "displacement against claimed speeds", "F2MD"),
        "drift": _tuned("sigma", 1.2, 3.5, "the same over the last seconds", "F2MD, over a window"),
        "heading": _tuned("sigma", 1.1, 3.0, "direction of motion against headings", "F2MD"),
        "turn": _tuned("sigma", 1.1, 3.0, "heading change against claimed yaw rates", "VASP yaw rate"),
        "acceleration": _tuned("sigma", 1.1, 3.5, "speed change against accelerations", "F2MD"),
        "impulse": _tuned("sigma", 1.1, 3.5, "the same over the last seconds", "F2MD, over a window"),
        "dynamics": _tuned("m/s2", 1.2, 5.0, "claimed acceleration, or speed change", "NextGen"),
        "size": _ruled("m", 0.15, "change of length or width, coded in 0.1 m", "VASP dimension"),
        "overlap": _tuned("1", 1.2, 0.2, "overlap, share of the smaller box", "F2MD intersection"),
        "appearance": _tuned("m", 1.1, 150.0, "how far within range a new station is", "F2MD appearance"),
        "kalman": _tuned("1", 1.2, 20.0, "innovation squared over its variance, 4 values", "F2MD Kalman"),
        "branch": _ruled("1", 0.5, "continues a flagged message", "ours"),
    }
)  # fmt: skip

THRESHOLDS: Mapping[str, float] = MappingProxyType(
    {name: tuned.THRESHOLDS[name] if check.rule is None else check.rule for name, check in CHECKS.items()}
)
"""The threshold of each check: from its rule, or from `tuned.py`."""

NEED_ROADS = ("position", "wrong_way")
"""Checks that are off where the receiver has no road map."""

OF_ACCELERATION = ("acceleration", "impulse", "dynamics")
"""Checks that say nothing about where a station is."""

GRIP_MPS2 = 9.81
"""Tyres on a dry road brake no harder (a friction of 1): faster changes of speed are not a hard braking."""


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """How well a receiver may expect an honest station's CAMs to agree with each other: 1 sigma.

    GNSS errors drift slowly (correlation 30 s), so differences over a second are far more accurate
    than each position; the `_per_root_s` are their growth. Between two CAMs drivers change their
    acceleration by about `acceleration_change_mps2`: over a time t, the displacement differs from the one by
    the mean speed by an eighth of it times t², the speed from the one by the accelerations by half of it
    times t.
    """

    position_m: float = 0.03
    position_m_per_root_s: float = 0.15
    speed_mps: float = 0.03
    speed_mps_per_root_s: float = 0.07
    acceleration_change_mps2: float = 1.2
    acceleration_noise_mps2: float = 1.0
    """Of one claimed (instantaneous) acceleration about the mean since the previous CAM."""
    heading_rad: float = 0.015
    heading_rad_per_root_s: float = 0.005
    yaw_rate_change_radps: float = 0.08
    overhang_m: float = 1.0
    """From the point that moves along the heading to the centre of the box."""
    turn_share: float = 0.1
    """Share of distance times turned angle by which an arc deviates from the mean of its end directions."""
    swing_share: float = 0.5
    """Share of the turned angle times half the length by which the centre of the box swings outwards."""
    acceleration_share: float = 0.3
    """Share of a claimed acceleration by which the driver changes it within a second."""
    speed_bias_mps: float = 0.1
    apart_m: float = 1.0
    """Of the distance between two stations, whose positions err independently of each other."""


@dataclass(frozen=True, kw_only=True)
class DetectorConfig:
    """All settings of the detector.

    thresholds: by check; a missing check is off. earshot_m: a new station nearer than this appears suddenly.
    settle_s: time after the first message in which every station is new. memory_s: a track without a message
    for this long is forgotten. pardon_s: a flagged station whose messages have been consistent for this long
    is trusted again; infinity for never. road_pardon_s: the same where only the road map spoke against it:
    who pulls out is beside or across the lane at first. acceleration_pardon_s: the same where only an
    acceleration that tyres allow did: who brakes hard is no liar, and estimates of it jump at times.
    window_s: of `drift` and `impulse`.
    """

    thresholds: Mapping[str, float] = field(default_factory=lambda: dict(THRESHOLDS))
    expectation: Expectation = Expectation()
    earshot_m: float = 300.0
    settle_s: float = 2.0
    memory_s: float = 4.0
    pardon_s: float = tuned.PARDON_S
    road_pardon_s: float = 1.0
    acceleration_pardon_s: float = 10.0
    window_s: float = 3.0
    kalman_acceleration_mps2: float = 2.0

    def __post_init__(self) -> None:
        unknown = sorted(set(self.thresholds) - set(CHECKS))
        if unknown:
            raise ValueError(f"unknown check {unknown[0]!r}; known: {', '.join(CHECKS)}")

    def with_thresholds(self, thresholds: Mapping[str, float]) -> DetectorConfig:
        """A copy with other thresholds."""
        return replace(self, thresholds=dict(thresholds))
