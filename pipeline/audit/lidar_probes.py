"""The probes of LiDAR clouds and of their points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.lidar_view import CloudView
from advpipe.pipeline.audit.probe import Float64, Probe

_COUNTS = ("points_added", "points_removed")
_RAYS = ("points_added", "max_off_ray_urad")
_INTENSITIES = ("max_intensity_change",)
AT_FACE_M = 0.0015


def _single(value: float) -> Float64:
    return np.array([value], np.float64)


def _interval_error_s(view: CloudView) -> float:
    """The log time's distance from a whole number of milliseconds after the one before."""
    if view.previous_ns is None:
        return np.nan
    return abs((view.log_time_ns - view.previous_ns + 500_000) % 1_000_000 - 500_000) / 1e9


CLOUD_PROBES: tuple[Probe[CloudView], ...] = (
    Probe("points", "cloud", "number of points", lambda v: _single(len(v.cloud)), _COUNTS),
    Probe("bytes", "cloud", "bytes of the message", lambda v: _single(v.message_bytes), _COUNTS),
    Probe("steps-back", "cloud", "share of points that stand before their place in the turn",
          lambda v: _single(_mean(np.where(np.isnan(v.steps_back), np.nan, v.steps_back > 0))),
          ("max_off_ray_urad",)),
    Probe("tail", "cloud", "largest angle between successive ones of the last 100 points",
          lambda v: _single(float(np.nan_to_num(v.jump_rad[-100:]).max(initial=0.0)))),
    Probe("compression", "cloud", "compressed share of the bytes", lambda v: _single(v.compressed_share),
          ("max_displacement_m", *_COUNTS)),
    Probe("off-grid", "cloud", "share of points off the grid of coordinates",
          lambda v: _single(_mean(~(v.off_grid_m == 0)))),
    Probe("off-ray", "cloud", "mean angle from the elevation of the stated ring",
          lambda v: _single(_mean(v.off_ray_rad)), _RAYS),
    Probe("shared-rays", "cloud", "share of points on a ray with another point",
          lambda v: _single(_mean(v.on_ray_of > 1)), _RAYS),
    Probe("equal-intensities", "cloud", "share of points with the intensity of another",
          lambda v: _single(_mean(v.same_intensity > 1)), _INTENSITIES),
    Probe("voxel-faces", "cloud", "share of points at faces of usual voxels",
          lambda v: _single(_mean(v.face_distance_m < AT_FACE_M)), ("max_off_ray_urad", "points_added")),
    Probe("interval", "cloud", "distance of the log time from whole milliseconds after the last",
          lambda v: _single(_interval_error_s(v))),
    Probe("log-time", "cloud", "log time after the stamp",
          lambda v: _single((v.log_time_ns - v.stamp_ns) / 1e9)),
    Probe("not-finite", "cloud", "share of points without coordinates",
          lambda v: _single(_mean(~np.isfinite(v.points).all(axis=1)))),
)  # fmt: skip

POINT_PROBES: tuple[Probe[CloudView], ...] = (
    Probe("place", "point", "place in the array, of its length",
          lambda v: np.arange(len(v.cloud)) / max(len(v.cloud), 1)),
    Probe("jump", "point", "angle to its neighbours in the array", lambda v: v.jump_rad, _RAYS),
    Probe("steps-back", "point", "columns and rings by which it stands before its place in the turn",
          lambda v: v.steps_back, ("max_off_ray_urad",)),
    Probe("ring", "point", "rings between the one that it states and the one of its elevation",
          lambda v: np.abs(v.cloud["ring"].astype(np.int64) - v.cells[0]) * (v.habits.sensor is not None),
          ("max_off_ray_urad",)),
    Probe("time", "point", "time from those of its neighbours in the array", lambda v: v.late_s),
    Probe("off-grid", "point", "distance from the grid of coordinates", lambda v: v.off_grid_m),
    Probe("off-ray", "point", "angle from the elevation of the stated ring",
          lambda v: v.off_ray_rad, _RAYS),
    Probe("off-column", "point", "distance from the middle of a column", lambda v: v.off_column, _RAYS),
    Probe("shared-ray", "point", "points on its ray", lambda v: v.on_ray_of.astype(np.float64), _RAYS),
    Probe("equal-intensity", "point", "points with its intensity",
          lambda v: v.same_intensity.astype(np.float64), _INTENSITIES),
    Probe("intensity", "point", "intensity", lambda v: v.cloud["intensity"].astype(np.float64),
          _INTENSITIES),
    Probe("equal-direction", "point", "points in exactly its direction",
          lambda v: v.same_place.astype(np.float64), ("max_off_ray_urad",)),
    Probe("voxel-face", "point", "distance to a face of usual voxels",
          lambda v: v.face_distance_m, ("max_off_ray_urad", "points_added")),
)  # fmt: skip


def _mean(values: npt.ArrayLike) -> float:
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else np.nan
