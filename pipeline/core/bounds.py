"""How small and how large a number of the scenario may be, and why: each kind of quantity once.

Keys whose kind is here may narrow it further. What several keys cost together is in `size.py`.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from advpipe.pipeline.core.section import Number, Probability

PlaceM = Annotated[Number, Field(ge=-1e5, le=1e5)]
"""A coordinate in the map's frame. Clouds are in single precision, which is 8 mm coarse at 100 km."""

HeightM = Annotated[Number, Field(ge=-1e4, le=1e4)]
"""A height in the map's frame, from the deepest mine to above the highest road."""

MountingM = Annotated[Number, Field(ge=-20, le=20)]
"""From a vehicle's centre to a sensor on it: half a road train, which is 36.5 m long."""

MountingHeightM = Annotated[Number, Field(ge=0.01, le=20)]
"""Of a sensor above the road: from the bumper's lip to a mast above the tallest vehicle."""

YawRad = Annotated[Number, Field(ge=-6.3, le=6.3)]
"""One turn either way; 90 is meant in degrees."""

RangeM = Annotated[Number, Field(ge=1, le=500)]
"""Of a LiDAR: below a metre it sees nothing but its own vehicle, and none for the road sees beyond 500 m."""

AttenuationPerM = Annotated[Number, Field(ge=0, le=1)]
"""Intensity lost: at 1 per metre a wall at 10 m is 20,000 times as dark; the densest fog has 0.6."""

MeshScale = Annotated[Number, Field(ge=1e-6, le=1000)]
"""Metres for each unit of a mesh: micrometres to kilometres."""

SpeedMps = Annotated[Number, Field(ge=0.1, le=100)]
"""Of a road user: slower ones never get anywhere, and 100 m/s is 360 km/h."""

AccelerationMps2 = Annotated[Number, Field(ge=0.1, le=10)]
"""Of a road user: no tyre holds more than 10 m/s^2."""

BlockM = Annotated[Number, Field(ge=10, le=2000)]
"""Between junctions of a generated map: nearer ones overlap, those farther apart make maps of 100 km."""

FixRateHz = Annotated[Number, Field(ge=0.001, le=1000)]
"""Of a satellite receiver: from one fix in a quarter of an hour to one in each of the finest steps."""

SnapshotRateHz = Annotated[Number, Field(ge=0.001, le=1000)]
"""Of what is recorded at intervals of its own: likewise."""

SampleRateHz = Annotated[Number, Field(ge=1, le=10_000)]
"""Of an inertial sensor: the fastest give 8 kHz; the filter needs two samples a step at least."""

AccelerometerRangeMps2 = Annotated[Number, Field(ge=20, le=20_000)]
"""Full scale: from 2 g, below which gravity saturates it on a slope, to 2000 g of a shock sensor."""

GyroscopeRangeRadps = Annotated[Number, Field(ge=1, le=200)]
"""Full scale: a car turns by 1 rad/s; 200 is twice what sensors for projectiles measure."""

CorrelationTimeS = Annotated[Number, Field(ge=0.001, le=1e6)]
"""Of what wanders: from the finest step to the longest drive."""

DriveTimeS = Annotated[Number, Field(ge=0.001, le=1e6)]
"""A time within a drive: from the finest step, in which SUMO counts, to eleven days."""

ShareOfSome = Annotated[Probability, Field(ge=1e-6)]
"""A share or chance that is not nothing: less than one in a million comes to none in any drive."""

StartStddevM = Annotated[Number, Field(ge=0.001, le=1000)]
StartStddevDeg = Annotated[Number, Field(ge=0.001, le=30)]
SlipStddevMps = Annotated[Number, Field(ge=1e-4, le=100)]
"""What a filter starts with or assumes: below these its matrices lose their digits."""

GateProbability = Annotated[Probability, Field(ge=0.5, lt=1)]
"""Share of true fixes that a filter's gate accepts: below one half, it would reject most of them."""

BitrateMbps = Annotated[Number, Field(ge=1.5, le=54)]
"""Of OFDM, from the slowest in a channel of 5 MHz to the fastest in one of 20 MHz."""

AirDelayS = Annotated[Number, Field(ge=0.0001, le=60)]
"""In a queue for the radio: no frame is shorter, and after a minute any CAM is history."""

KeptS = Annotated[Number, Field(ge=0.01, le=60)]
"""For how long a Local Dynamic Map keeps what it heard; CAMs come ten times a second at most."""

AntennaM = Annotated[Number, Field(ge=0.1, le=50)]
"""Height of an antenna above the ground; at none, both rays of the two-ray model cancel out."""
