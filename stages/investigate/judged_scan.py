"""A LiDAR's cloud as the cues see it, and what they remember of the sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from advpipe.pipeline.attack_detection.density import LossModel
from advpipe.pipeline.attack_detection.range_image import RangeImage
from advpipe.pipeline.attack_detection.sensor_geometry import (
    MIN_RANGE_M,
    MIN_TOLERANCE_RAD,
    Directions,
    SensorGeometry,
)
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.investigate.observations import LidarScan

LEARN_FROM = 3
"""Clouds from which the rays of a sensor are learnt. They may be attacked: medians ignore a few points."""

TYPICAL, TIMES = 0.9, 4.0
"""A point is off its ray where it is so many times farther from it than this share of the points."""


@dataclass(frozen=True)
class KnownSensor:
    """The rays of a LiDAR, and how often they do not return."""

    geometry: SensorGeometry
    losses: LossModel


@dataclass(frozen=True)
class JudgedScan:
    """One cloud. name: of its sensor. base_SE3_lidar: None where the bag does not say how it is mounted.
    sensor: None until enough clouds have been seen, and for clouds that tell no rings apart."""

    name: str
    scan: LidarScan
    base_SE3_lidar: Float64 | None
    sensor: KnownSensor | None

    @property
    def time_ns(self) -> int:
        """When it arrived."""
        return self.scan.time_ns

    @property
    def cloud(self) -> Cloud:
        """All its points (N,)."""
        return self.scan.scan.cloud

    @cached_property
    def points_m(self) -> Float64:
        """Those that return from somewhere (K, 3), in the LiDAR's frame."""
        points = xyz(self.cloud).astype(np.float64)
        kept: Float64 = points[np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) > MIN_RANGE_M)]
        return kept

    @cached_property
    def base_points_m(self) -> Float64:
        """The same above the ground below the vehicle; without a mount, in the LiDAR's frame."""
        return (
            self.points_m
            if self.base_SE3_lidar is None
            else transform_points(self.base_SE3_lidar, self.points_m)
        )

    @cached_property
    def image(self) -> RangeImage | None:
        """Its range image; None while the sensor is unknown."""
        return None if self.sensor is None else RangeImage.of(self.cloud, self.sensor.geometry)


class LearntSensor:
    """Learns the rays of one LiDAR from its first clouds."""

    def __init__(self) -> None:
        self._first: list[Cloud] = []
        self._known: KnownSensor | None = None
        self._is_done = False

    def known(self, cloud: Cloud) -> KnownSensor | None:
        """The sensor, once it is known; takes this cloud in until then."""
        if not self._is_done:
            self._first.append(cloud)
            if len(self._first) == LEARN_FROM:
                self._known, self._is_done = _learnt(self._first), True
                self._first.clear()
            return None
        return self._known


def _learnt(clouds: list[Cloud]) -> KnownSensor | None:
    if not sum(map(len, clouds)):
        return None
    found = SensorGeometry.learnt(clouds)
    if found is None:
        return None
    geometry = _robust(found, clouds)
    return KnownSensor(geometry, LossModel.learnt([RangeImage.of(cloud, geometry) for cloud in clouds]))


def _robust(found: SensorGeometry, clouds: list[Cloud]) -> SensorGeometry:
    """With tolerances that a tenth of the points, if they are false, cannot widen."""
    cloud = np.concatenate(clouds)
    way, ring = Directions.of(cloud), cloud["ring"].astype(np.int64)
    off_rad = np.abs(way.elevation_rad - found.elevations_rad[ring])[np.isfinite(way.range_m)]
    step_rad = 2 * np.pi / found.columns
    place = way.azimuth_rad / step_rad - found.phase
    beside_rad = np.abs(place - np.rint(place))[np.isfinite(way.range_m)] * step_rad
    return replace(
        found,
        elevation_tolerance_rad=max(MIN_TOLERANCE_RAD, TIMES * float(np.quantile(off_rad, TYPICAL))),
        azimuth_tolerance_rad=max(MIN_TOLERANCE_RAD, TIMES * float(np.quantile(beside_rad, TYPICAL))),
    )
