"""Tables in Feather files, with the columns and number types that a reader asks for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError

Columns = dict[str, npt.NDArray[Any]]

STAMP = "timestamp_ns"
POSE = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
TEXTS = frozenset({"sensor_name", "track_uuid", "category"})
WHOLE = frozenset({STAMP, "num_interior_pts", "laser_number", "offset_ns", "height_px", "width_px"})


def read_feather(file: Path, names: Sequence[str]) -> Columns:
    """The named columns of a Feather file: texts as `str`, whole numbers as int64, the rest as float64.

    Raises AdvpipeError for a file that is not Feather, lacks a column, or has one of another type.
    """
    import pyarrow as pa
    from pyarrow import feather

    try:
        table = feather.read_table(file, memory_map=False)
    except (OSError, pa.ArrowException) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise AdvpipeError(f"{file}: cannot be read as a Feather file: {reason:.120}") from None
    missing = [name for name in names if name not in table.column_names]
    if missing:
        has = ", ".join(table.column_names)
        raise AdvpipeError(
            f"{file}: no column {', '.join(missing)} (it has {has:.200}); is this a log of Argoverse 2?"
        )
    return {name: _values(table[name], name, file) for name in names}


def _values(column: Any, name: str, file: Path) -> npt.NDArray[Any]:
    import pyarrow as pa

    if column.null_count:
        raise AdvpipeError(f"{file}: {column.null_count} values of {name} are missing")
    stored = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if name in TEXTS:
        fits = pa.types.is_string(stored) or pa.types.is_large_string(stored)
    elif name in WHOLE:
        fits = pa.types.is_integer(stored)
    else:
        fits = pa.types.is_floating(stored) or pa.types.is_integer(stored)
    if not fits:
        raise AdvpipeError(f"{file}: the column {name} is of type {column.type}, which it cannot have")
    if name in TEXTS:
        return np.array(column.to_pylist(), dtype=str)
    return np.asarray(column.to_numpy(), np.int64 if name in WHOLE else np.float64)
