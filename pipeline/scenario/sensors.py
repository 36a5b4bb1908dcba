"""The section `sensors`: what the instrumented vehicles carry."""

from __future__ import annotations

import difflib
import math
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field, model_validator

from advpipe.pipeline.core.shown import cut, shown
from advpipe.pipeline.scenario.base import (
    Name,
    NotNegative,
    Number,
    Probability,
    Section,
    Switch,
    Whole,
    Word,
)
from advpipe.pipeline.scenario.bounds import (
    AccelerometerRangeMps2,
    AttenuationPerM,
    CorrelationTimeS,
    FixRateHz,
    GateProbability,
    GyroscopeRangeRadps,
    MountingHeightM,
    MountingM,
    RangeM,
    SampleRateHz,
    SlipStddevMps,
    StartStddevDeg,
    StartStddevM,
)
from advpipe.pipeline.scenario.lidar_presets import LIDAR_PRESETS

_FAN = ("channels", "upper_fov", "lower_fov")

VEHICLE_FRAMES = ("base_link", "imu", "odom")
"""Frames that each vehicle has beside those of its LiDARs, which have their names."""

MAX_RAYS = 2_000_000
"""Rays of one turn; a few hundred bytes of memory each."""


class LidarSensor(Section):
    """A rotating LiDAR; names and meanings as in CARLA's sensor.lidar.ray_cast."""

    vehicle: Word = "ego"
    preset: Word | None = Field(
        None,
        description=f"a known sensor ({', '.join(LIDAR_PRESETS)}); every key given beside it wins over it",
    )
    x_m: MountingM = Field(0.0, description="mounting place before the vehicle's centre")
    y_m: MountingM = Field(0.0, description="mounting place to the left of the vehicle's centre")
    z_m: MountingHeightM = Field(1.8, description="mounting height above the road")
    roll_deg: Number = Field(0.0, ge=-180, le=180)
    pitch_deg: Number = Field(0.0, ge=-90, le=90, description="positive looks down")
    yaw_deg: Number = Field(0.0, ge=-180, le=180)
    channels: Whole = Field(64, ge=1, le=256)
    range: RangeM = Field(100.0, description="metres")
    points_per_second: Whole = Field(
        1_152_000, ge=1, le=20_000_000, description="rays of all channels together"
    )
    rotation_frequency: Number = Field(
        10.0, ge=0.1, le=1000, description="turns a second; one turn is one cloud"
    )
    upper_fov: Number = Field(2.0, ge=-90, le=90, description="degrees")
    lower_fov: Number = Field(-24.8, ge=-90, le=90, description="degrees")
    vertical_angles_deg: tuple[Annotated[Number, Field(ge=-90, le=90)], ...] | None = Field(
        None,
        max_length=256,
        description="elevation of each channel from the lowest up; even between the fovs if left out",
    )
    range_reflectivity: Probability = Field(
        0.0,
        description="diffuse reflectivity that is seen nine times in ten at `range`, darker things less far; "
        "0 sees everything in range, as CARLA does",
    )
    atmosphere_attenuation_rate: AttenuationPerM = Field(
        0.004, description="intensity lost, exp(-a d), per metre"
    )
    dropoff_general_rate: Probability = Field(0.02, description="share of points lost at random")
    dropoff_intensity_limit: Probability = Field(0.3, description="no intensity-based loss above it")
    dropoff_zero_intensity: Probability = Field(0.4, description="share of points lost at intensity zero")
    noise_stddev: NotNegative = Field(0.02, le=1.0, description="of the range, in metres")
    motion_distortion: Switch = Field(
        False, description="rays leave one after the other, as the vehicle moves on"
    )
    coordinate_grid_m: NotNegative = Field(
        0.0, le=0.1, description="round coordinates to this binary grid, like 0.001953125; 0 keeps them"
    )

    @model_validator(mode="before")
    @classmethod
    def _defaults(cls, keys: Any) -> Any:
        """What the preset and the angles set, below what the file itself says."""
        if not isinstance(keys, dict):
            return keys
        name, given = keys.get("preset"), dict(keys)
        if isinstance(name, str):
            if name not in LIDAR_PRESETS:
                close = difflib.get_close_matches(cut(name.lower()), LIDAR_PRESETS, n=1)
                hint = f"did you mean {close[0]!r}? " if close else ""
                raise ValueError(
                    f"preset {shown(name)} is no known sensor; {hint}known: {', '.join(LIDAR_PRESETS)}"
                )
            if any(key in given for key in _FAN):  # another fan than the preset's: its angles do not fit
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
                f"coordinate_grid_m {self.coordinate_grid_m:g} is no power of two; the nearest is {nearest}"
            )
        return self

    @property
    def columns(self) -> int:
        """Firings of each channel in one turn."""
        return int(self.points_per_second / self.rotation_frequency / self.channels)


class GnssSensor(Section):
    """A satellite receiver: white noise over a slowly wandering (Gauss-Markov) offset."""

    rate_hz: FixRateHz | None = Field(None, description="fixes a second; one in every step if left out")
    white_stddev_m: NotNegative = Field(
        0.3, le=1000, description="of each horizontal axis; twice that in height"
    )
    drift_stddev_m: NotNegative = Field(
        1.0, le=1000, description="of each horizontal axis; twice that in height"
    )
    drift_time_s: CorrelationTimeS = Field(60.0, description="correlation time of the wandering offset")

    def steps_per_fix(self, step_s: float) -> int:
        """Steps from one fix to the next; ValueError where that is no whole number."""
        if self.rate_hz is None:
            return 1
        return _whole(
            1 / (self.rate_hz * step_s),
            f"sensors.gnss.rate_hz {self.rate_hz:g} does not divide the step rate {1 / step_s:g} Hz",
        )


class ImuSensor(Section):
    """Accelerometers and gyroscopes: white noise over a bias that wanders (Gauss-Markov).

    The densities are those of a BMI088, a MEMS part made for vehicles and robots.
    """

    rate_hz: SampleRateHz = Field(100.0, description="samples a second")
    accelerometer_noise_density: NotNegative = Field(
        1.9e-3, le=10, description="m/s^2 per square root of hertz"
    )
    gyroscope_noise_density: NotNegative = Field(2.4e-4, le=1, description="rad/s per square root of hertz")
    accelerometer_bias_stddev_mps2: NotNegative = Field(0.05, le=10, description="of each axis")
    gyroscope_bias_stddev_radps: NotNegative = Field(0.001, le=1, description="of each axis")
    bias_time_s: CorrelationTimeS = Field(300.0, description="correlation time of the biases")
    accelerometer_range_mps2: AccelerometerRangeMps2 = Field(
        235.0, description="full scale, 24 g; beyond it, samples stay there"
    )
    gyroscope_range_radps: GyroscopeRangeRadps = Field(
        34.9, description="full scale, 2000 degrees/s; beyond it, samples stay there"
    )

    def samples_per_step(self, step_s: float) -> int:
        """Samples in one step; ValueError where that is no whole number from 2 on."""
        return _whole(
            self.rate_hz * step_s,
            f"sensors.imu.rate_hz {self.rate_hz:g} is no whole multiple, twice or more, of the step rate "
            f"{1 / step_s:g} Hz",
            least=2,
        )


class WheelOdometrySensor(Section):
    """Speed and turn rate from the wheels: white noise, and errors drawn once for each vehicle."""

    speed_white_stddev_mps: NotNegative = Field(0.05, le=100)
    speed_scale_stddev: NotNegative = Field(0.005, le=0.2, description="tyres of another radius")
    turn_rate_white_stddev_radps: NotNegative = Field(0.01, le=10)
    turn_rate_scale_stddev: NotNegative = Field(0.01, le=0.2, description="another effective track width")
    curvature_stddev_1pm: NotNegative = Field(
        0.0006, le=0.1, description="left and right tyres of different radius: turn in rad per metre driven"
    )


class LocalisationFilter(Section):
    """What the on-board filter assumes beside the models of its sensors."""

    start_position_stddev_m: StartStddevM = Field(
        5.0, description="of the pose that it starts from, each axis"
    )
    start_heading_stddev_deg: StartStddevDeg = 5.0
    start_tilt_stddev_deg: StartStddevDeg = Field(2.0, description="of roll and of pitch")
    slip_stddev_mps: SlipStddevMps = Field(0.1, description="of the speed sideways and upwards")
    slip_lever_m: NotNegative = Field(1.5, le=100, description="what a turn of 1 rad/s adds to it, in m/s")
    slip_time_s: CorrelationTimeS = Field(0.5, description="for how long such a slide lasts")
    gate_probability: GateProbability | None = Field(
        None, description="drop fixes whose innovation is beyond this chi-square quantile, like 0.999"
    )


class Sensors(Section):
    """What the instrumented vehicles carry: LiDARs by name, and on each vehicle all the rest."""

    lidars: dict[Name, LidarSensor] = Field({"lidar": LidarSensor()}, max_length=100, description="by name")
    gnss: GnssSensor = GnssSensor()
    imu: ImuSensor = ImuSensor()
    wheel_odometry: WheelOdometrySensor = WheelOdometrySensor()
    localisation: LocalisationFilter = LocalisationFilter()

    @model_validator(mode="after")
    def _frames(self) -> Sensors:
        taken = next((name for name in self.lidars if name in VEHICLE_FRAMES), None)
        if taken is not None:
            raise ValueError(f"lidars.{taken} has the name of another frame of its vehicle; rename it")
        return self

    def check_rates(self, step_s: float) -> None:
        """ValueError where the rate of a sensor does not fit the step."""
        self.gnss.steps_per_fix(step_s)
        self.imu.samples_per_step(step_s)


def _whole(number: float, complaint: str, least: int = 1) -> int:
    if abs(number - round(number)) > 1e-6 * number or round(number) < least:
        raise ValueError(complaint)
    return round(number)
