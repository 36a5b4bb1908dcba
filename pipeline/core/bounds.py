"""The bounds of numbers in the scenario file, with their reasons: one type for each quantity.

A key may add bounds that its type lacks; a bound of the type hides the key's own. `size.py` bounds what
several keys cost together.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from advpipe.pipeline.core.section import Number, Probability

PlaceM = Annotated[Number, Field(ge=-1e5, le=1e5)]
"""A coordinate in the map frame. Clouds are in single precision, whose resolution at 100 km is 8 mm."""

HeightM = Annotated[Number, Field(ge=-1e4, le=1e4)]
"""A height in the map frame, from the deepest mine to above the highest road."""

MountingM = Annotated[Number, Field(ge=-20, le=20)]
"""Distance from a vehicle's centre to a sensor on it: half the length of a road train is 18 m."""

MountingHeightM = Annotated[Number, Field(ge=0.01, le=20)]
"""Height of a sensor above the road: from the lip of a bumper to a mast above the tallest vehicle."""

YawRad = Annotated[Number, Field(ge=-6.3, le=6.3)]
"""A yaw angle of up to one turn either way; a value such as 90 is a mistake for degrees."""

RangeM = Annotated[Number, Field(ge=1, le=500)]
"""Range of a LiDAR: below 1 m it sees only its own vehicle, and no automotive LiDAR sees beyond 500 m."""

AttenuationPerM = Annotated[Number, Field(ge=0, le=1)]
"""Attenuation of intensity: at 1 per metre a wall at 10 m is 20,000 times darker; the densest fog has 0.6."""

MeshScale = Annotated[Number, Field(ge=1e-6, le=1000)]
"""Metres per unit of a mesh, for meshes in micrometres to kilometres."""

SpeedMps = Annotated[Number, Field(ge=0.1, le=100)]
"""Speed of a road user: below 0.1 m/s it never arrives, and 100 m/s is 360 km/h."""

AccelerationMps2 = Annotated[Number, Field(ge=0.1, le=10)]
"""Acceleration of a road user: no road tyre transmits more than 10 m/s^2."""

BlockM = Annotated[Number, Field(ge=10, le=2000)]
"""Distance between junctions of a generated map: closer ones overlap, and 2 km make maps of 100 km."""

FixRateHz = Annotated[Number, Field(ge=0.001, le=1000)]
"""Rate of a GNSS receiver: from one fix in a quarter of an hour to one per step of 1 ms."""

SnapshotRateHz = Annotated[Number, Field(ge=0.001, le=1000)]
"""Rate of periodic snapshots, such as of the Local Dynamic Map: the same range."""

SampleRateHz = Annotated[Number, Field(ge=1, le=10_000)]
"""Rate of an IMU: the fastest sample at 8 kHz; the filter needs at least two samples a step."""

AccelerometerRangeMps2 = Annotated[Number, Field(ge=20, le=20_000)]
"""Full scale of an accelerometer: from 2 g (with less, gravity saturates it) to 2000 g of a shock sensor."""

GyroscopeRangeRadps = Annotated[Number, Field(ge=1, le=200)]
"""Full scale of a gyroscope: a car turns at 1 rad/s; 200 is twice what sensors for projectiles measure."""

CorrelationTimeS = Annotated[Number, Field(ge=0.001, le=1e6)]
"""Correlation time of a slowly varying error: from the finest step to the longest drive."""

DriveTimeS = Annotated[Number, Field(ge=0.001, le=1e6)]
"""A time within a drive: from 1 ms, SUMO's resolution, to eleven days."""

StepS = Annotated[Number, Field(ge=0.001, le=1)]
"""A step of the clock: CAMs are sent once a second at least."""

ShareOfSome = Annotated[Probability, Field(ge=1e-6)]
"""A share or probability above zero: below one in a million, nothing happens in any drive."""

StartStddevM = Annotated[Number, Field(ge=0.001, le=1000)]
StartStddevDeg = Annotated[Number, Field(ge=0.001, le=30)]
SlipStddevMps = Annotated[Number, Field(ge=1e-4, le=100)]
"""Standard deviations that a filter starts with or assumes: below these bounds its matrices are singular
in double precision."""

GateProbability = Annotated[Probability, Field(ge=0.5, lt=1)]
"""Share of genuine fixes that a filter's gate accepts: below one half, it would reject most of them."""

BitrateMbps = Annotated[Number, Field(ge=1.5, le=54)]
"""Data rate of OFDM, from the slowest in a channel of 5 MHz to the fastest in one of 20 MHz."""

AirDelayS = Annotated[Number, Field(ge=0.0001, le=60)]
"""Time in a radio's queue: no frame takes less than 0.1 ms, and after a minute any CAM is outdated."""

KeptS = Annotated[Number, Field(ge=0.01, le=60)]
"""Time for which a Local Dynamic Map keeps an entry; CAMs are sent at most ten times a second."""

AntennaM = Annotated[Number, Field(ge=0.1, le=50)]
"""Height of an antenna above the ground; at 0 m, both rays of the two-ray model cancel each other."""
