"""Clouds from points whose fields have names: PCD, PLY, structured arrays and PointCloud2."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud

MOST_POINTS = 10_000_000
"""Of one cloud: more than any LiDAR returns in a turn, so it is a map, or a damaged file."""

Array = npt.NDArray[Any]

FIELD_NAMES: Mapping[str, tuple[str, ...]] = {
    "x": ("x",),
    "y": ("y",),
    "z": ("z",),
    "intensity": (
        *("intensity", "i", "intensities", "reflectivity", "reflectance", "remission"),
        "scalar_intensity",
    ),
    "ring": ("ring", "channel", "laser_id", "laser", "line", "scalar_ring"),
    "time": ("time", "t", "timestamp", "time_stamp", "offset_time", "point_time_offset", "scalar_time"),
}  # fmt: skip
"""Names that drivers and programs give our fields, in lower case; the first one present counts."""

_LONGEST_TURN_S = 2.0
_NS_PER_S = 1e9


def cloud_of_fields(fields: Mapping[str, Array], stamp_ns: int | None, scale_intensity: float = 1.0) -> Cloud:
    """A cloud (N,) from arrays (N,) of numbers by their names; what is missing is 0.

    Whole numbers in a field of times are nanoseconds, others seconds. Times that begin at an epoch are taken
    relative to the stamp, or to the first point where the stamp is unknown or of another clock. Raises
    AdvpipeError without x, y and z, and for a channel that is none.
    """
    found = {
        ours: named for ours, names in FIELD_NAMES.items() if (named := _first(fields, names)) is not None
    }
    if missing := [name for name in "xyz" if name not in found]:
        known = shorten(", ".join(list(fields)[:20]), 300) or "none"
        raise AdvpipeError(f"its points have no field {', '.join(missing)}; they have {known}")
    cloud = np.zeros(len(found["x"]), POINT_DTYPE)
    with np.errstate(over="ignore", invalid="ignore"):  # becomes infinite, which the checks see
        for name in ("x", "y", "z", "intensity"):
            if name in found:
                cloud[name] = found[name]
        if scale_intensity != 1.0:
            cloud["intensity"] *= np.float32(scale_intensity)
    if "ring" in found:
        cloud["ring"] = _rings(found["ring"])
    if "time" in found:
        cloud["time"] = _times_s(found["time"], stamp_ns)
    return cloud


def _first(fields: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    lower = {name.lower(): values for name, values in fields.items()}
    return next((lower[name] for name in names if name in lower), None)


def _rings(rings: Array) -> Array:
    """Channels as whole numbers."""
    values = np.nan_to_num(rings.astype(np.float64), nan=0.0)
    if len(values) and (values.min() < 0 or values.max() > np.iinfo(np.uint16).max):
        raise AdvpipeError(
            f"a channel of its points is {values.min():g} or {values.max():g}, not 0 to 65,535"
        )
    return values.astype(np.uint16)


def _times_s(times: Array, stamp_ns: int | None) -> Array:
    """Seconds after the stamp."""
    if not len(times):
        return times.astype(np.float32)
    is_whole = times.dtype.kind in "iu"
    first = times.min() if is_whole else np.nanmin(times) if np.isfinite(times).any() else 0.0
    span = times.max() - first if is_whole else np.nanmax(times) - first
    to_s = 1 / _NS_PER_S if is_whole else _unit_s(float(span))
    begin = 0 if abs(float(first)) * to_s < _LONGEST_TURN_S else first
    relative_s = (times - begin).astype(np.float64) * to_s
    if begin and stamp_ns is not None:
        begin_s = (
            (int(first) - stamp_ns) / _NS_PER_S if is_whole else float(first) * to_s - stamp_ns / _NS_PER_S
        )
        relative_s += begin_s if abs(begin_s) < _LONGEST_TURN_S else 0.0
    return np.nan_to_num(relative_s, posinf=0.0, neginf=0.0)


def _unit_s(span: float) -> float:
    """Seconds, or the largest smaller unit in which a turn is not too long."""
    return next((unit for unit in (1.0, 1e-3, 1e-6, 1e-9) if span * unit <= _LONGEST_TURN_S), 1.0)


def read_exactly(stream: BinaryIO, size_bytes: int) -> bytes:
    """So many bytes of a file. Raises AdvpipeError before any is read if the file has fewer."""
    left_bytes = os.fstat(stream.fileno()).st_size - stream.tell()
    if left_bytes < size_bytes:
        raise AdvpipeError(
            f"it is truncated: {size_bytes:,} bytes of points are declared, {left_bytes:,} are left"
        )
    return stream.read(size_bytes)
