"""How ETSI's common data dictionary (TS 102 894-2) codes each quantity of a CAM as an integer.

Values are in SI units and radians, None where unavailable, and infinite where
"out of range", which means larger than the largest value that the field can code.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.cam_error import CamError

_PER_DEGREE = 180 / math.pi
_ROUNDING_NOISE = 1e-6
"""Share of a unit: a value this little above a whole number of units is rounded down to it."""


@dataclass(frozen=True)
class CamQuantity:
    """A number: `code = value * per_unit`, rounded to the nearest, or up where `ceil` is set.

    low, high: the codes of plain values. beyond: the code of values above `high`. Without one, values
    outside are coded as the nearest end where `clamp` is set (the dictionary defines the ends as "or
    more") and are refused elsewhere. cycle: an angle's codes in a full turn.
    """

    name: str
    per_unit: float
    low: int
    high: int
    unavailable: int | None = None
    beyond: int | None = None
    ceil: bool = False
    clamp: bool = False
    cycle: int | None = None

    def code(self, value: float | None) -> int:
        """The code of a value. Raises CamError for NaN, and for values that the field cannot code."""
        if value is None:
            if self.unavailable is None:
                raise CamError(f"{self.name} is missing, but a CAM requires it")
            return self.unavailable
        steps = value * self.per_unit
        if not math.isfinite(steps):
            if steps > 0 and (self.beyond is not None or self.clamp):
                return self.high if self.beyond is None else self.beyond
            raise CamError(f"{self.name} is {value}, which a CAM cannot represent")
        code = math.ceil(steps - _ROUNDING_NOISE) if self.ceil else round(steps)
        if self.cycle is not None:
            return code % self.cycle
        if self.low <= code <= self.high:
            return code
        if code > self.high and self.beyond is not None:
            return self.beyond
        if self.clamp or (code < self.low and self.beyond is not None and value >= 0):
            return self.low if code < self.low else self.high
        raise CamError(f"{self.name} {value:g} is outside the range of a CAM, {self._range}")

    def value(self, code: int) -> float | None:
        """The value that a code stands for."""
        if code == self.unavailable:
            return None
        return math.inf if code == self.beyond else code / self.per_unit

    @property
    def _range(self) -> str:
        return f"{self.low / self.per_unit:g} to {self.high / self.per_unit:g}"


@dataclass(frozen=True)
class Classes:
    """A confidence in classes, an ENUMERATED of the ASN.1: name i stands for values up to `bounds[i]`.

    Two names follow the last bound's: out of range and unavailable.
    """

    name: str
    bounds: tuple[float, ...]
    names: tuple[str, ...]

    def code(self, value: float | None) -> str:
        """The name of a value's class. Raises CamError for NaN and negative values."""
        if value is None:
            return _UNAVAILABLE
        if not value >= 0:
            raise CamError(f"{self.name} is {value}; a confidence cannot be negative")
        place = bisect_left(self.bounds, value * (1 - _ROUNDING_NOISE))
        return self.names[place] if place < len(self.bounds) else _OUT_OF_RANGE

    def value(self, code: str) -> float | None:
        """The upper end of a class."""
        if code == _UNAVAILABLE:
            return None
        return math.inf if code == _OUT_OF_RANGE else self.bounds[self.names.index(code)]


_OUT_OF_RANGE, _UNAVAILABLE = "outOfRange", "unavailable"


def _classes(name: str, prefix: str, scale: float, *bounds: str) -> Classes:
    """Classes whose names are a prefix and the bound in the dictionary's digits, such as 001-00."""
    values = tuple(float(bound.replace("-", ".")) * scale for bound in bounds)
    return Classes(name, values, tuple(f"{prefix}-{bound}" for bound in bounds))


LATITUDE = CamQuantity("latitude_deg", 1e7, -900_000_000, 900_000_000, 900_000_001)
LONGITUDE = CamQuantity("longitude_deg", 1e7, -1_800_000_000, 1_800_000_000, 1_800_000_001)
SEMI_AXIS = CamQuantity("semi-axis of the position in metres", 100, 0, 4093, 4095, beyond=4094, ceil=True)
ALTITUDE = CamQuantity("altitude_m", 100, -100_000, 800_000, 800_001, clamp=True)
ALTITUDE_CONFIDENCE = _classes(
    *("altitude_confidence_m", "alt", 1),
    *("000-01", "000-02", "000-05", "000-10", "000-20", "000-50", "001-00"),
    *("002-00", "005-00", "010-00", "020-00", "050-00", "100-00", "200-00"),
)
HEADING = CamQuantity("heading_rad", 10 * _PER_DEGREE, 0, 3599, 3601, cycle=3600)  # the standard forbids 3600
HEADING_CONFIDENCE = CamQuantity(
    "heading_confidence_rad", 10 * _PER_DEGREE, 1, 125, 127, beyond=126, ceil=True
)
SPEED = CamQuantity("speed_mps", 100, 0, 16381, 16383, beyond=16382, ceil=True)
SPEED_CONFIDENCE = CamQuantity("speed_confidence_mps", 100, 1, 125, 127, beyond=126, ceil=True)
ACCELERATION = CamQuantity("acceleration in m/s2", 10, -160, 160, 161, ceil=True, clamp=True)
ACCELERATION_CONFIDENCE = CamQuantity(
    "confidence of an acceleration in m/s2", 10, 0, 100, 102, beyond=101, ceil=True
)
CURVATURE = CamQuantity("curvature_per_m", 10_000, -1023, 1022, 1023, clamp=True)
CURVATURE_CONFIDENCE = _classes(
    *("curvature_confidence_per_m", "onePerMeter", 1),
    *("0-00002", "0-0001", "0-0005", "0-002", "0-01", "0-1"),
)
YAW_RATE = CamQuantity("yaw_rate_radps", 100 * _PER_DEGREE, -32766, 32766, 32767, clamp=True)
YAW_RATE_CONFIDENCE = _classes(
    *("yaw_rate_confidence_radps", "degSec", 1 / _PER_DEGREE),
    *("000-01", "000-05", "000-10", "001-00", "005-00", "010-00", "100-00"),
)
STEERING_ANGLE = CamQuantity("steering_wheel_rad", _PER_DEGREE / 1.5, -511, 511, 512, clamp=True)
STEERING_ANGLE_CONFIDENCE = CamQuantity(
    "steering_wheel_confidence_rad", _PER_DEGREE / 1.5, 1, 125, 127, beyond=126, ceil=True
)
LENGTH = CamQuantity("length_m", 10, 1, 1021, 1023, beyond=1022, ceil=True)
WIDTH = CamQuantity("width_m", 10, 1, 60, 62, beyond=61, ceil=True)
DELTA_DEGREES = CamQuantity("degrees to a path point", 1e7, -131_071, 131_071, 131_072)
DELTA_ALTITUDE = CamQuantity("altitude to a path point in metres", 100, -12_700, 12_799, 12_800)
DELTA_TIME = CamQuantity("seconds to a path point", 100, 1, 65_535, clamp=True)
