"""The section `sensors`: what the instrumented vehicles carry."""

from __future__ import annotations

from pydantic import Field, model_validator

from advpipe.pipeline.scenario.base import Name, NotNegative, Positive, Probability, Section


class LidarSensor(Section):
    """A rotating LiDAR; names and meanings as in CARLA's sensor.lidar.ray_cast."""

    vehicle: str = "ego"
    preset: str | None = Field(None, description="a known sensor; every key given beside it wins over it")
    x_m: float = Field(0.0, description="mounting place before the vehicle's centre")
    y_m: float = Field(0.0, description="mounting place to the left of the vehicle's centre")
    z_m: Positive = Field(1.8, description="mounting height above the road")
    roll_deg: float = Field(0.0, ge=-180, le=180)
    pitch_deg: float = Field(0.0, ge=-90, le=90, description="positive looks down")
    yaw_deg: float = Field(0.0, ge=-180, le=180)
    channels: int = Field(64, ge=1, le=256)
    range: Positive = Field(100.0, le=500, description="metres")
    points_per_second: int = Field(
        1_152_000, ge=1, le=20_000_000, description="rays of all channels together"
    )
    rotation_frequency: float = Field(
        10.0, ge=0.1, le=1000, description="turns a second; one turn is one cloud"
    )
    upper_fov: float = Field(2.0, ge=-90, le=90, description="degrees")
    lower_fov: float = Field(-24.8, ge=-90, le=90, description="degrees")
    vertical_angles_deg: tuple[float, ...] | None = Field(
        None, description="elevation of each channel from the lowest up; even between the fovs if left out"
    )
    atmosphere_attenuation_rate: NotNegative = Field(
        0.004, description="intensity lost, exp(-a d), per metre"
    )
    dropoff_general_rate: Probability = Field(0.02, description="share of points lost at random")
    dropoff_intensity_limit: Probability = Field(0.3, description="no intensity-based loss above it")
    dropoff_zero_intensity: Probability = Field(0.4, description="share of points lost at intensity zero")
    noise_stddev: NotNegative = Field(0.02, le=1.0, description="of the range, in metres")
    motion_distortion: bool = Field(
        False, description="rays leave one after the other, as the vehicle moves on"
    )
    coordinate_grid_m: NotNegative = Field(
        0.0, le=0.1, description="round coordinates to this binary grid, like 0.001953125; 0 keeps them"
    )

    @model_validator(mode="after")
    def _fov(self) -> LidarSensor:
        if self.lower_fov >= self.upper_fov and self.channels > 1:
            raise ValueError(f"lower_fov {self.lower_fov:g} is not below upper_fov {self.upper_fov:g}")
        if self.columns < 1:
            raise ValueError("points_per_second gives less than one ray per channel and turn")
        return self

    @property
    def columns(self) -> int:
        """Firings of each channel in one turn."""
        return int(self.points_per_second / self.rotation_frequency / self.channels)


class GnssSensor(Section):
    """A satellite receiver: white noise over a slowly wandering (Gauss-Markov) offset."""

    rate_hz: Positive | None = Field(None, description="fixes a second; one in every step if left out")
    white_stddev_m: NotNegative = Field(0.3, description="of each horizontal axis; twice that in height")
    drift_stddev_m: NotNegative = Field(1.0, description="of each horizontal axis; twice that in height")
    drift_time_s: Positive = Field(60.0, description="correlation time of the wandering offset")

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

    rate_hz: Positive = Field(100.0, le=10_000, description="samples a second")
    accelerometer_noise_density: NotNegative = Field(1.9e-3, description="m/s^2 per square root of hertz")
    gyroscope_noise_density: NotNegative = Field(2.4e-4, description="rad/s per square root of hertz")
    accelerometer_bias_stddev_mps2: NotNegative = Field(0.05, description="of each axis")
    gyroscope_bias_stddev_radps: NotNegative = Field(0.001, description="of each axis")
    bias_time_s: Positive = Field(300.0, description="correlation time of the biases")
    accelerometer_range_mps2: Positive = Field(
        235.0, ge=20, description="full scale, 24 g; beyond it, samples stay there"
    )
    gyroscope_range_radps: Positive = Field(
        34.9, ge=1, description="full scale, 2000 degrees/s; beyond it, samples stay there"
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

    speed_white_stddev_mps: NotNegative = 0.05
    speed_scale_stddev: NotNegative = Field(0.005, le=0.2, description="tyres of another radius")
    turn_rate_white_stddev_radps: NotNegative = 0.01
    turn_rate_scale_stddev: NotNegative = Field(0.01, le=0.2, description="another effective track width")
    curvature_stddev_1pm: NotNegative = Field(
        0.0006, le=0.1, description="left and right tyres of different radius: turn in rad per metre driven"
    )


class LocalisationFilter(Section):
    """What the on-board filter assumes beside the models of its sensors."""

    start_position_stddev_m: Positive = Field(5.0, description="of the pose that it starts from, each axis")
    start_heading_stddev_deg: Positive = Field(5.0, le=30)
    start_tilt_stddev_deg: Positive = Field(2.0, le=30, description="of roll and of pitch")
    slip_stddev_mps: Positive = Field(0.1, description="of the speed sideways and upwards")
    slip_lever_m: NotNegative = Field(1.5, description="what a turn of 1 rad/s adds to it, in m/s")
    slip_time_s: Positive = Field(0.5, description="for how long such a slide lasts")
    gate_probability: Probability | None = Field(
        None, lt=1, description="drop fixes whose innovation is beyond this chi-square quantile, like 0.999"
    )


class Sensors(Section):
    """What the instrumented vehicles carry: LiDARs by name, and on each vehicle all the rest."""

    lidars: dict[Name, LidarSensor] = Field({"lidar": LidarSensor()}, description="by name")
    gnss: GnssSensor = GnssSensor()
    imu: ImuSensor = ImuSensor()
    wheel_odometry: WheelOdometrySensor = WheelOdometrySensor()
    localisation: LocalisationFilter = LocalisationFilter()

    def check_rates(self, step_s: float) -> None:
        """ValueError where the rate of a sensor does not fit the step."""
        self.gnss.steps_per_fix(step_s)
        self.imu.samples_per_step(step_s)


def _whole(number: float, complaint: str, least: int = 1) -> int:
    if abs(number - round(number)) > 1e-6 * number or round(number) < least:
        raise ValueError(complaint)
    return round(number)
