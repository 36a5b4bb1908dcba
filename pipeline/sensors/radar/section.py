"""The section of a radar in the scenario file."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import MountingHeightM, MountingM, RangeM
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.section import Number, Probability, Reference, Switch, Whole
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.sensors.radar.presets import RADAR_PRESETS
from advpipe.pipeline.sensors.sensor import MountedSection

MOST_CELLS = 1e10
"""Limit on the cells of the range-Doppler map: no automotive radar has a millionth of them."""

MOST_RADAR_RAYS = 1_000_000
"""Limit on the rays of one scan; each needs a few hundred bytes of memory."""


class RadarSensor(MountedSection):
    """A radar; keys have the names and meanings of CARLA's sensor.other.radar where that has them."""

    preset: Reference | None = Field(
        None,
        description=f"a kind of radar ({', '.join(RADAR_PRESETS)}); other keys here override its values",
    )
    x_m: MountingM = Field(2.3, description="mounting position forward of the vehicle's centre")
    y_m: MountingM = Field(0.0, description="mounting position to the left of the vehicle's centre")
    z_m: MountingHeightM = Field(0.5, description="mounting height above the road")
    pitch_deg: Number = Field(0.0, ge=-90, le=90, description="mounting pitch; positive points down")
    yaw_deg: Number = Field(0.0, ge=-180, le=180, description="mounting yaw; positive turns to the left")
    horizontal_fov: Number = Field(30.0, ge=0.1, lt=360, description="horizontal field of view in degrees")
    vertical_fov: Number = Field(30.0, ge=0.1, le=180, description="vertical field of view in degrees")
    range: RangeM = Field(100.0, description="maximum range in metres; the receiver filters out all beyond")
    points_per_second: Whole = Field(
        1500, ge=1, le=20_000_000, description="rays per second that sample what is no road user"
    )
    sensor_tick: Number = Field(
        0.0, ge=0, le=10, description="time between scans in seconds; 0: a scan in every step"
    )
    frequency_ghz: Number = Field(76.5, ge=1, le=300, description="carrier frequency")
    range_resolution_m: Number = Field(0.75, ge=0.01, le=50, description="width of a range cell")
    azimuth_resolution_deg: Number = Field(4.0, ge=0.1, le=180, description="width of a beam")
    elevation_resolution_deg: Number = Field(
        0.0, ge=0, le=180, description="height of a beam; 0: the radar does not measure elevation"
    )
    velocity_resolution_mps: Number = Field(0.1, ge=0.001, le=50, description="width of a Doppler cell")
    max_velocity_mps: Number = Field(
        70.0, ge=0.1, le=500, description="unambiguous velocity; faster ones fold into plus or minus this"
    )
    unambiguous_azimuth_deg: Number = Field(
        90.0,
        ge=5,
        le=90,
        description="unambiguous azimuth; targets beyond it appear inside (grating lobes of a sparse array); "
        "90: antennas half a wavelength apart",
    )
    detection_range_m: Number = Field(
        90.0, ge=1, le=2000, description="range at which a target of 10 m² is detected with probability 0.9"
    )
    false_alarm_probability: Number = Field(
        1e-6, ge=1e-12, le=0.1, description="of each cell of the range-Doppler map, which sets the threshold"
    )
    cfar_cells: Whole = Field(
        32, ge=2, le=10_000, description="neighbouring cells of which the CFAR averages the noise"
    )
    swerling: Literal[0, 1, 3] = Field(
        1,
        description="Swerling's case of the fluctuation of road users from scan to scan (2 and 4 are within "
        "a scan, which is a single look)",
    )
    ground_reflection: Probability = Field(
        0.3, description="amplitude reflected by the road, for multipath; 0: none"
    )
    guard_rail_reflection: Probability = Field(
        0.5, description="power reflected by guard rails, in which road users have mirror images; 0: none"
    )
    underbody_share: Probability = Field(
        0.03,
        description="share of the power that reaches what a vehicle hides, by the road beneath it; 0: none",
    )
    scatterers: Whole = Field(16, ge=1, le=1000, description="points that sample each road user")
    wheels: Switch = Field(False, description="whether turning wheels spread the velocities of vehicles")
    max_returns: Whole = Field(
        256, ge=1, le=100_000, description="longest list of detections; those of the largest RCS are kept"
    )

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, keys: Any) -> Any:
        """Add the keys of the preset; keys in the file take precedence."""
        if not isinstance(keys, dict):
            return keys
        name = keys.get("preset")
        if not isinstance(name, str):
            return keys
        if name not in RADAR_PRESETS:
            raise ValueError(f"preset {short_repr(name)} is unknown; {known_names(name, RADAR_PRESETS)}")
        return RADAR_PRESETS[name] | keys

    @model_validator(mode="after")
    def _sizes(self) -> RadarSensor:
        for resolution, whole in (
            ("range_resolution_m", self.range),
            ("azimuth_resolution_deg", self.horizontal_fov),
            ("elevation_resolution_deg", self.vertical_fov),
            ("velocity_resolution_mps", 2 * self.max_velocity_mps),
        ):
            if getattr(self, resolution) > whole:
                raise ValueError(
                    f"{resolution} {getattr(self, resolution):g} is beyond all that it divides, {whole:g}"
                )
        if self.cells > MOST_CELLS:
            raise ValueError(f"the range-Doppler map has {self.cells:.3g} cells, over {MOST_CELLS:g}")
        return self

    @property
    def cells(self) -> int:
        """Number of cells of the range-Doppler map."""
        ranges = max(int(self.range / self.range_resolution_m), 1)
        return ranges * max(int(2 * self.max_velocity_mps / self.velocity_resolution_mps), 1)
