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

    white_stddev_m: NotNegative = Field(0.3, description="of each horizontal axis; twice that in height")
    drift_stddev_m: NotNegative = Field(1.0, description="of each horizontal axis; twice that in height")
    drift_time_s: Positive = Field(60.0, description="correlation time of the wandering offset")


class Sensors(Section):
    """What the instrumented vehicles carry: LiDARs by name, and on each vehicle the other three."""

    lidars: dict[Name, LidarSensor] = Field({"lidar": LidarSensor()}, description="by name")
    gnss: GnssSensor = GnssSensor()
