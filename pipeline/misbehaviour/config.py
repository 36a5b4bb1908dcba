"""The checks of the detector: what each measures, above what it objects, and where that comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

from advpipe.pipeline.misbehaviour import tuned


class Check(NamedTuple):
    """One line of the table of checks.

    unit: of the statistic and its threshold; "sigma" is a residual over its standard deviation as the
    receiver expects it (`Expectation`). rule: the statistic above which a message is flagged where that
    follows from a rule, None where it is tuned. margin: by which the largest statistic on clean tuning drives
    is exceeded. least: what tuning never goes below, since short drives show too little.
    """

    unit: str
    rule: float | None
    margin: float
    least: float
    meaning: str
    source: str

    @property
    def is_tuned(self) -> bool:
        return self.rule is None


def _ruled(unit: str, threshold: float, meaning: str, source: str) -> Check:
    return Check(unit, threshold, 1.0, threshold, meaning, source)


def _tuned(unit: str, margin: float, least: float, meaning: str, source: str) -> Check:
    return Check(unit, None, margin, least, meaning, source)


CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "decoding": _ruled("1", 0.5, "bytes that are no CAM", "EN 302 637-2"),
        "format": _ruled("fields", 0.5, "fields left out or out of range", "TS 102 894-2"),
        "identity": _ruled("1", 0.5, "the receiver's own id, or a type that changes", "EN 302 637-2"),
        "range": _tuned("m", 1.5, 1000.0, "distance from the receiver", "F2MD range"),
        "speed": _tuned("m/s", 1.2, 20.0, "speed", "F2MD speed"),
        "position": _tuned("m", 1.5, 1.5, "distance from the nearest lane", "F2MD position"),
        "wrong_way": _tuned("rad", 1.2, 0.6, "angle to the direction of every lane near", "F2MD, VASP"),
        "freshness": _tuned("s", 1.2, 0.2, "age on arrival, or time from the future", "Artery's LDM"),
        "frequency": _ruled("Hz", 12.5, "1 / time since the last CAM", "EN 302 637-2, 6.1.3"),
        "position_speed": _tuned("sigma", 1.1, 3.5, "way since the last CAM against speeds told", "F2MD"),
        "drift": _tuned("sigma", 1.2, 3.5, "the same over the last seconds", "F2MD, over a window"),
        "heading": _tuned("sigma", 1.1, 3.0, "direction of that way against headings told", "F2MD"),
        "turn": _tuned("sigma", 1.1, 3.0, "heading's change against yaw rates told", "VASP yaw rate"),
        "acceleration": _tuned("sigma", 1.1, 3.5, "speed's change against accelerations told", "F2MD"),
        "impulse": _tuned("sigma", 1.1, 3.5, "the same over the last seconds", "F2MD, over a window"),
        "dynamics": _tuned("m/s2", 1.2, 5.0, "acceleration told, or speed's change over time", "NextGen"),
        "size": _ruled("m", 0.15, "change of length or width, told in 0.1 m", "VASP dimension"),
        "overlap": _tuned("1", 1.2, 0.4, "share of the smaller box that another covers", "F2MD intersection"),
        "appearance": _tuned("m", 1.1, 150.0, "how far within earshot a new station is", "F2MD appearance"),
        "kalman": _tuned("1", 1.2, 20.0, "innovation squared over its variance, 4 values", "F2MD Kalman"),
        "branch": _ruled("1", 0.5, "goes on from a message that was flagged", "ours"),
    }
)  # fmt: skip

THRESHOLDS: Mapping[str, float] = MappingProxyType(
    {name: tuned.THRESHOLDS[name] if check.rule is None else check.rule for name, check in CHECKS.items()}
)
"""Above which each check objects: by its rule, or as `tuned.py` has it."""

NEED_ROADS = ("position", "wrong_way")
"""Checks that say nothing where the receiver has no map of the roads."""


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """How well an honest station's CAMs agree with each other, as a receiver may expect: 1 sigma.

    The errors of satellite receivers wander (correlation 30 s), so differences over a second are far better
    than each position is; the `_per_root_s` are their growth. Between two CAMs drivers change their
    acceleration by about `acceleration_change_mps2`: over a time t the way differs from that by the mean of
    the speeds by an eighth of it times t², the speed from that by the accelerations by half of it times t.
    """

    position_m: float = 0.03
    position_m_per_root_s: float = 0.15
    speed_mps: float = 0.03
    speed_mps_per_root_s: float = 0.07
    acceleration_change_mps2: float = 1.2
    acceleration_noise_mps2: float = 1.0
    """Of one told acceleration, that of an instant, about the mean since the CAM before."""
    heading_rad: float = 0.015
    heading_rad_per_root_s: float = 0.005
    yaw_rate_change_radps: float = 0.08
    overhang_m: float = 1.0
    """From the place that moves along the heading to the middle of the box."""
    turn_share: float = 0.1
    """Of the way times the angle turned: how far an arc is from the mean of its ends' directions."""
    speed_bias_mps: float = 0.1


@dataclass(frozen=True, kw_only=True)
class DetectorConfig:
    """All settings of the detector.

    thresholds: by check; a check that is missing is off. earshot_m: within which new stations are sudden.
    settle_s: after the first message, while everybody is new. memory_s: a track without a message for so
    long is forgotten. pardon_s: a flagged station whose messages agree with each other for so long, and
    with everything else, is believed again; infinity for never. window_s: of `drift` and
    `impulse`.
    """

    thresholds: Mapping[str, float] = field(default_factory=lambda: dict(THRESHOLDS))
    expectation: Expectation = Expectation()
    earshot_m: float = 300.0
    settle_s: float = 2.0
    memory_s: float = 4.0
    pardon_s: float = tuned.PARDON_S
    window_s: float = 3.0
    kalman_acceleration_mps2: float = 2.0

    def __post_init__(self) -> None:
        unknown = sorted(set(self.thresholds) - set(CHECKS))
        if unknown:
            raise ValueError(f"no check is named {unknown[0]}; known: {', '.join(CHECKS)}")

    def with_thresholds(self, thresholds: Mapping[str, float]) -> DetectorConfig:
        """The same with other thresholds."""
        return replace(self, thresholds=dict(thresholds))
