"""Clouds in files of one format each: raw floats, NumPy, PCD, PLY."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud

COLUMN_NAMES = ("x", "y", "z", "intensity", "ring", "time")
SKIPPED = "_"

Table = npt.NDArray[np.floating[Any]]


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


def cloud_of_columns(table: Table, names: Sequence[str], scale_intensity: float = 1.0) -> Cloud:
    """A cloud (N,) from a table (N, C) whose columns have these names; missing fields are 0."""
    cloud = np.zeros(len(table), POINT_DTYPE)
    for place, name in enumerate(names):
        if name != SKIPPED:
            cloud[name] = table[:, place]
    if scale_intensity != 1.0:
        cloud["intensity"] *= np.float32(scale_intensity)
    return cloud


def read_floats(file: Path, columns: int) -> npt.NDArray[np.float32]:
    """A file of little-endian float32 as a table (N, columns). Raises AdvpipeError for a truncated one."""
    try:
        values = np.fromfile(file, "<f4")
        size_bytes = file.stat().st_size
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    if size_bytes % (4 * columns):
        raise AdvpipeError(
            f"{file}: {size_bytes} bytes are not a whole number of points of {columns} float32; the file is "
            "truncated, or its points have other columns"
        )
    return values.reshape(-1, columns)


PointReader = Callable[[Path, "Sequence[str] | None", float], Cloud]
"""Reads a file, given the names of its columns (None if it names them itself) and a factor on intensities."""


def _read_bin(file: Path, names: Sequence[str] | None, scale_intensity: float) -> Cloud:
    names = names or COLUMN_NAMES[:4]
    return cloud_of_columns(read_floats(file, len(names)), names, scale_intensity)


POINT_READERS: Mapping[str, PointReader] = {".bin": _read_bin}
"""By the suffix of the file, in lower case."""
