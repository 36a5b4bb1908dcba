"""The checks of the detector: what each measures, above what it objects, and where that comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple


class Check(NamedTuple):
    """One line of the table of checks.

    unit: of the statistic and its threshold; "sigma" is a residual over its standard deviation as the
    receiver expects it (`Expectation`). threshold: the statistic above which a message is flagged. margin:
    by which the largest statistic on a clean tuning drive is exceeded, None where the threshold follows from
    a rule and is not tuned.
    """

    unit: str
    threshold: float
    margin: float | None
    meaning: str
    source: str


CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "format": Check("fields", 0.5, None, "fields left out or out of range, no CAM", "TS 102 894-2"),
        "identity": Check("1", 0.5, None, "the receiver's own id, or a type that changes", "EN 302 637-2"),
        "range": Check("m", 2000.0, 1.5, "distance from the receiver", "F2MD range"),
        "speed": Check("m/s", 60.0, 1.2, "speed", "F2MD speed"),
        "position": Check("m", 1.5, 1.5, "distance from the nearest lane", "F2MD position"),
        "wrong_way": Check("rad", 0.63, 1.2, "angle to the direction of every lane near", "F2MD, VASP"),
        "freshness": Check("s", 0.2, 1.2, "age on arrival, or time from the future", "Artery's LDM"),
        "frequency": Check("Hz", 12.5, None, "1 / time since the last CAM", "EN 302 637-2, 6.1.3"),
        "position_speed": Check("sigma", 11.2, 1.1, "way since the last CAM against speeds told", "F2MD"),
        "drift": Check("sigma", 6.4, 1.2, "the same over the last seconds", "F2MD, over a window"),
        "heading": Check("sigma", 3.8, 1.1, "direction of that way against headings told", "F2MD"),
        "turn": Check("sigma", 11.8, 1.1, "heading's change against yaw rates told", "VASP yaw rate"),
        "acceleration": Check("sigma", 16.2, 1.1, "speed's change against accelerations told", "F2MD"),
        "impulse": Check("sigma", 4.2, 1.1, "the same over the last seconds", "F2MD, over a window"),
        "dynamics": Check("m/s2", 6.0, 1.2, "acceleration told, or speed's change over time", "NextGen"),
        "size": Check("m", 0.15, None, "change of length or width, told in 0.1 m", "VASP dimension"),
        "overlap": Check("1", 0.4, 1.2, "share of the smaller box that another covers", "F2MD intersection"),
        "appearance": Check("m", 150.0, 1.1, "how far within earshot a new station is", "F2MD appearance"),
        "kalman": Check("1", 143.0, 1.2, "innovation squared over its variance, 4 values", "F2MD Kalman"),
        "branch": Check("1", 0.5, None, "goes on from a message that was flagged", "ours"),
    }
)  # fmt: skip
"""The thresholds with a margin are those that `tuning.clean_thresholds` finds on 20 s of the default drive
(`boulevard`, seed 1), save that of the speed, which is far above what is driven there, and of the range."""


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

    thresholds: Mapping[str, float] = field(
        default_factory=lambda: {name: check.threshold for name, check in CHECKS.items()}
    )
    expectation: Expectation = Expectation()
    earshot_m: float = 300.0
    settle_s: float = 2.0
    memory_s: float = 4.0
    pardon_s: float = 10.0
    window_s: float = 3.0
    kalman_acceleration_mps2: float = 2.0

    def __post_init__(self) -> None:
        unknown = sorted(set(self.thresholds) - set(CHECKS))
        if unknown:
            raise ValueError(f"no check is named {unknown[0]}; known: {', '.join(CHECKS)}")

    def with_thresholds(self, thresholds: Mapping[str, float]) -> DetectorConfig:
        """The same with other thresholds."""
        return replace(self, thresholds=dict(thresholds))
