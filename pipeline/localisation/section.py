"""The sections of GNSS, IMU, wheel odometry and the on-board filter in the scenario file."""

from __future__ import annotations

from typing import Protocol

from pydantic import Field

from advpipe.pipeline.core.bounds import (
    AccelerometerRangeMps2,
    CorrelationTimeS,
    FixRateHz,
    GateProbability,
    GyroscopeRangeRadps,
    SampleRateHz,
    SlipStddevMps,
    StartStddevDeg,
    StartStddevM,
)
from advpipe.pipeline.core.section import (
    NotNegative,
    Section,
)


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


class OnBoardSensors(Protocol):
    """What a vehicle localises itself with: the sections of its sensors, and of the filter over them."""

    @property
    def gnss(self) -> GnssSensor: ...
    @property
    def imu(self) -> ImuSensor: ...
    @property
    def wheel_odometry(self) -> WheelOdometrySensor: ...
    @property
    def localisation(self) -> LocalisationFilter: ...


def _whole(number: float, complaint: str, least: int = 1) -> int:
    if abs(number - round(number)) > 1e-6 * number or round(number) < least:
        raise ValueError(complaint)
    return round(number)
