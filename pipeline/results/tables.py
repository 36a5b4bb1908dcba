"""The columns of `results.parquet`: a row for every detection and every object, of every frame and cloud."""

from __future__ import annotations

import pyarrow as pa

from advpipe.pipeline.geometry.boxes import BOX_COLUMNS
from advpipe.pipeline.results.figures import CRITERIA

_WORDS = pa.dictionary(pa.int32(), pa.string())
MATCH_SCHEMA = pa.schema(
    [
        ("bag", _WORDS),
        ("detector", _WORDS),
        ("cloud", _WORDS),
        ("frame", pa.int64()),
        ("stamp_ns", pa.int64()),
        ("kind", _WORDS),
        ("number", pa.int32()),
        ("class", _WORDS),
        ("id", pa.string()),
        ("score", pa.float64()),
        *((column, pa.float64()) for column in BOX_COLUMNS),
        ("points", pa.int64()),
        ("occlusion", pa.float64()),
        *((f"fate_{criterion}", _WORDS) for criterion in CRITERIA),
        *((f"match_{criterion}", pa.int32()) for criterion in CRITERIA),
        ("is_lost", pa.bool_()),
        ("is_emptied", pa.bool_()),
        ("is_new", pa.bool_()),
    ]
)
