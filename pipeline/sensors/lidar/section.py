"""The section of a LiDAR in the scenario file."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import (
    AttenuationPerM,
    MountingHeightM,
    MountingM,
    RangeM,
)
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.section import (
    NotNegative,
    Number,
    Probability,
    Reference,
    Switch,
    Whole,
)
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.sensors.lidar.imperfections import Imperfections
from advpipe.pipeline.sensors.lidar.presets import LIDAR_PRESETS
from advpipe.pipeline.sensors.lidar.response import IntensityResponse
from advpipe.pipeline.sensors.sensor import MountedSection

_FAN = ("channels", "upper_fov", "lower_fov")

MAX_RAYS = 2_000_000
"""Limit on the rays of one turn; each needs a few hundred bytes of memory."""


class LidarSensor(MountedSection):
    """A rotating LiDAR; keys have the names and meanings of CARLA's sensor.lidar.ray_cast."""

    preset: Reference | None = Field(
        None,
        description=f"a known sensor ({', '.join(LIDAR_PRESETS)}); other keys given here override its values",
    )
    x_m: MountingM = Field(0.0, description="mounting position forward of the vehicle's centre")
    y_m: MountingM = Field(0.0, description="mounting position to the left of the vehicle's centre")
    z_m: MountingHeightM = Field(1.8, description="mounting height above the road")
    roll_deg: Number = Field(
        0.0, ge=-180, le=180, description="mounting roll; positive lowers the right side"
    )
    pitch_deg: Number = Field(0.0, ge=-90, le=90, description="mounting pitch; positive points down")
    yaw_deg: Number = Field(0.0, ge=-180, le=180, description="mounting yaw; positive turns to the left")
    channels: Whole = Field(64, ge=1, le=256, description="number of channels (rings)")
    range: RangeM = Field(100.0, description="maximum range in metres")
    points_per_second: Whole = Field(
        1_152_000, ge=1, le=20_000_000, description="rays per second of all channels together"
    )
    rotation_frequency: Number = Field(
        10.0, ge=0.1, le=1000, description="turns per second; each turn gives one cloud"
    )
    upper_fov: Number = Field(2.0, ge=-90, le=90, description="elevation of the highest channel in degrees")
    lower_fov: Number = Field(-24.8, ge=-90, le=90, description="elevation of the lowest channel in degrees")
    vertical_angles_deg: tuple[Annotated[Number, Field(ge=-90, le=90)], ...] | None = Field(
        None,
        max_length=256,
        description="elevation of each channel, lowest first; by default evenly spaced from lower_fov to "
        "upper_fov",
    )
    range_reflectivity: Probability = Field(
        0.0,
        description="diffuse reflectivity that is detected with probability 0.9 at `range`; darker surfaces "
        "have a shorter range; 0: everything in range is detected, as in CARLA",
    )
    atmosphere_attenuation_rate: AttenuationPerM = Field(
        0.004, description="attenuation a of the intensity, exp(-a d), per metre"
    )
    dropoff_general_rate: Probability = Field(0.01, description="share of points that are lost randomly")
    dropoff_intensity_limit: Probability = Field(
        0.05, description="signal above which no points are lost by their signal"
    )
    dropoff_zero_intensity: Probability = Field(
        0.6, description="share of points that are lost at signal 0; it falls linearly up to the limit"
    )
    noise_stddev: NotNegative = Field(
        0.02, le=1.0, description="standard deviation of the range noise of a strong return in metres"
    )
    intensity_response: IntensityResponse = Field(
        IntensityResponse(), description="how the reported intensity follows from the signal"
    )
    imperfections: Imperfections = Field(
        Imperfections(), description="what sets a real sensor apart from an ideal one, one key an effect"
    )
    motion_distortion: Switch = Field(
        False, description="columns of a turn leave one after another while the vehicle moves"
    )
    coordinate_grid_m: NotNegative = Field(
        0.0,
        le=0.1,
        description="grid to which coordinates are rounded, a power of two such as 0.001953125; 0: no "
        "rounding",
    )

    @model_validator(mode="before")
    @classmethod
    def _defaults(cls, keys: Any) -> Any:
        """Add the keys of the preset and the angles; keys in the file take precedence."""
        if not isinstance(keys, dict):
            return keys
        name, given = keys.get("preset"), dict(keys)
        if isinstance(name, str):
            if name not in LIDAR_PRESETS:
                known = known_names(name, LIDAR_PRESETS)
                raise ValueError(f"preset {short_repr(name)} is unknown; {known}")
            if any(key in given for key in _FAN):  # the preset's angles do not fit another fan
                given.setdefault("vertical_angles_deg", None)
            given = LIDAR_PRESETS[name] | given
        angles = keys.get("vertical_angles_deg")
        if isinstance(angles, (list, tuple)) and angles:
            fan = dict(zip(_FAN, (len(angles), angles[-1], angles[0]), strict=True))
            given |= {key: value for key, value in fan.items() if key not in keys}
        return given

    @model_validator(mode="after")
    def _fan(self) -> LidarSensor:
        angles = self.vertical_angles_deg
        if angles is None and self.lower_fov >= self.upper_fov and self.channels > 1:
            raise ValueError(f"lower_fov {self.lower_fov:g} is not below upper_fov {self.upper_fov:g}")
        if angles is not None and len(angles) != self.channels:
            raise ValueError(f"vertical_angles_deg holds {len(angles)} angles for {self.channels} channels")
        if angles is not None and any(a >= b for a, b in pairwise(angles)):
            raise ValueError("vertical_angles_deg does not rise from each channel to the next")
        if self.columns < 1:
            raise ValueError("points_per_second gives less than one ray per channel and turn")
        if self.columns * self.channels > MAX_RAYS:
            raise ValueError(
                f"one turn has {self.columns * self.channels} rays, over {MAX_RAYS}; "
                f"lower points_per_second or raise rotation_frequency"
            )
        return self

    @model_validator(mode="after")
    def _grid(self) -> LidarSensor:
        if self.coordinate_grid_m and math.frexp(self.coordinate_grid_m)[0] != 0.5:
            nearest = 2.0 ** round(math.log2(self.coordinate_grid_m))
            raise ValueError(
                f"coordinate_grid_m {self.coordinate_grid_m:g} is not a power of two; the nearest is "
                f"{nearest}"
            )
        return self

    @property
    def columns(self) -> int:
        """Number of columns (firings of each channel) in one turn."""
        return int(self.points_per_second / self.rotation_frequency / self.channels)
