"""Clouds in files of one format each: raw floats, NumPy, PCD, PLY."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.import_.pcd_file import read_pcd
from advpipe.stages.import_.ply_file import read_ply
from advpipe.stages.import_.point_fields import MOST_POINTS, Array, cloud_of_fields

COLUMN_NAMES = ("x", "y", "z", "intensity", "ring", "time")
SKIPPED = "_"

Table = npt.NDArray[np.number[Any]]


def parse_columns(text: str) -> tuple[str, ...]:
    """The names of columns, such as `x,y,z,intensity`. Raises UsageError for an unknown or missing one."""
    names = tuple(name.strip() for name in text.split(","))
    for name in names:
        if name not in (*COLUMN_NAMES, SKIPPED):
            raise UsageError(f"columns {text!r}: unknown column {name!r}; {known_names(name, COLUMN_NAMES)}")
        if name != SKIPPED and names.count(name) > 1:
            raise UsageError(f"columns {text!r}: {name} appears twice; write {SKIPPED} for one to skip")
    if missing := {"x", "y", "z"} - set(names):
        raise UsageError(f"columns {text!r}: {', '.join(sorted(missing))} missing")
    return names


def cloud_of_columns(
    table: Table, names: Sequence[str], scale_intensity: float = 1.0, stamp_ns: int | None = None
) -> Cloud:
    """A cloud (N,) from a table (N, C) whose columns have these names; missing fields are 0."""
    fields = {name: table[:, place] for place, name in enumerate(names) if name != SKIPPED}
    return cloud_of_fields(fields, stamp_ns, scale_intensity)


def read_floats(file: Path, columns: int) -> npt.NDArray[np.float32]:
    """A file of little-endian float32 as a table (N, columns). Raises AdvpipeError for a truncated one."""
    try:
        size_bytes = file.stat().st_size
        if size_bytes % (4 * columns):
            raise AdvpipeError(
                f"{file}: {size_bytes} bytes are not a whole number of points of {columns} float32; the file "
                "is truncated, or its points have other columns (--columns)"
            )
        if size_bytes > 4 * columns * MOST_POINTS:
            points = size_bytes // (4 * columns)
            raise AdvpipeError(f"{file}: has {points:,} points; a cloud has at most {MOST_POINTS:,}")
        values = np.fromfile(file, "<f4", size_bytes // 4)
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    return values[: len(values) // columns * columns].reshape(-1, columns)


PointReader = Callable[[Path, "Sequence[str] | None", float, "int | None"], Cloud]
"""Reads a file, given the names of its columns (None if it names them itself, or has the usual ones), a
factor on intensities, and the stamp, None where it is unknown. Raises AdvpipeError and OSError."""


def read_point_file(
    file: Path, names: Sequence[str] | None, scale_intensity: float = 1.0, stamp_ns: int | None = None
) -> Cloud:
    """The cloud in a file of one of the known formats; names: of the columns of a .bin or .npy file.

    Raises AdvpipeError, one line with the file's name.
    """
    try:
        return POINT_READERS[file.suffix.lower()](file, names, scale_intensity, stamp_ns)
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    except AdvpipeError as error:
        text = str(error)
        raise AdvpipeError(text if text.startswith(f"{file}: ") else f"{file}: {text}") from None


def _read_bin(file: Path, names: Sequence[str] | None, scale_intensity: float, stamp_ns: int | None) -> Cloud:
    names = names or COLUMN_NAMES[:4]
    return cloud_of_columns(read_floats(file, len(names)), names, scale_intensity, stamp_ns)


def _read_npy(file: Path, names: Sequence[str] | None, scale_intensity: float, stamp_ns: int | None) -> Cloud:
    """A table (N, C) of numbers, or points (N,) with named fields."""
    try:
        points: Array = np.lib.format.open_memmap(file, mode="r")
    except OSError:
        raise
    except Exception:  # the header is Python's own syntax, and can fail in any way
        raise AdvpipeError("it is not a .npy file of numbers, or is truncated") from None
    if len(points.shape) == 0 or len(points) > MOST_POINTS:
        raise AdvpipeError(f"it has the shape {points.shape}; a cloud has at most {MOST_POINTS:,} points")
    if points.dtype.names is not None and points.ndim == 1:
        fields = {name: points[name] for name in points.dtype.names if _is_number(points.dtype[name])}
        return cloud_of_fields(fields, stamp_ns, scale_intensity)
    if points.ndim != 2 or not _is_number(points.dtype):
        raise AdvpipeError(f"it has the shape {points.shape} of {points.dtype}, not (N, C) of numbers")
    names = names or COLUMN_NAMES[:4]
    if points.shape[1] != len(names):
        raise AdvpipeError(
            f"its points have {points.shape[1]} columns, not the {len(names)} of {','.join(names)}; name "
            f"them (--columns), {SKIPPED} for one to skip"
        )
    return cloud_of_columns(points, names, scale_intensity, stamp_ns)


def _is_number(dtype: np.dtype[Any]) -> bool:
    return dtype.kind in "fiu" and dtype.subdtype is None


def _read_pcd(file: Path, names: Sequence[str] | None, scale_intensity: float, stamp_ns: int | None) -> Cloud:
    return cloud_of_fields(read_pcd(file), stamp_ns, scale_intensity)


def _read_ply(file: Path, names: Sequence[str] | None, scale_intensity: float, stamp_ns: int | None) -> Cloud:
    return cloud_of_fields(read_ply(file), stamp_ns, scale_intensity)


POINT_READERS: Mapping[str, PointReader] = {
    ".bin": _read_bin,
    ".npy": _read_npy,
    ".pcd": _read_pcd,
    ".ply": _read_ply,
}
"""By the suffix of the file, in lower case."""
