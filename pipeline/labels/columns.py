"""Columns of a table of labels, by name and type, as an Arrow schema."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

Type = Literal["int32", "int64", "uint32", "uint64", "float32", "float64", "bool", "string", "words"]
"""Types by their names in Arrow; `words`: strings with few distinct values, as a dictionary."""

Columns = Mapping[str, Type]


def arrow_schema(columns: Columns) -> Any:
    """The pyarrow schema of these columns, in their order."""
    import pyarrow as pa

    dictionary = pa.dictionary(pa.int32(), pa.string())
    return pa.schema(
        [
            (name, dictionary if column_type == "words" else pa.type_for_alias(column_type))
            for name, column_type in columns.items()
        ]
    )
