"""Parquet files that Arrow writes: other rows, types, encodings, numbers of rows, and bytes."""

from __future__ import annotations

import io
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import reject
from hypothesis import strategies as st

from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import NUMBERS, TEXTS

TYPES = (
    *(pa.int8(), pa.int64(), pa.uint64(), pa.float32(), pa.float64(), pa.string(), pa.binary(), pa.bool_()),
    *(
        pa.null(),
        pa.timestamp("ns"),
        pa.list_(pa.int32()),
        pa.struct([("a", pa.int32())]),
        pa.decimal128(5, 2),
    ),
    pa.dictionary(pa.int32(), pa.string()),
)
ROWS = (2, 1000, 300_000, 30_000_000, 30_000_000)
"""Equal rows, which pack to next to nothing."""

LONG_TEXT = "x" * 3_000_000


def read(data: bytes) -> pa.Table:
    return pq.read_table(io.BytesIO(data))


def written(table: pa.Table, **options: Any) -> bytes:
    stream = io.BytesIO()
    pq.write_table(table, stream, **options)
    return stream.getvalue()


@st.composite
def edited_columns(draw: st.DrawFn, table: pa.Table) -> tuple[pa.Table, str]:
    """The table with one column of another kind, name, or number, or with other values."""
    place = draw(st.integers(0, table.num_columns - 1))
    name, column = table.column_names[place], table.column(place).combine_chunks()
    edit = draw(st.sampled_from(["value", "value", "value", "type", "drop", "rename", "repeat", "null"]))
    if edit == "drop":
        return table.remove_column(place), f"without {name}"
    if edit == "rename":
        other = draw(st.sampled_from([*TEXTS[:8], *table.column_names]))
        return table.rename_columns(
            [other if n == name else n for n in table.column_names]
        ), f"{name}: {other!r}"
    if edit == "repeat":
        return table.append_column(name, column), f"{name} twice"
    if edit == "null":
        return table.set_column(place, name, pa.nulls(len(table), column.type)), f"{name} is null"
    if edit == "type":
        kind = draw(st.sampled_from(TYPES))
        try:
            changed = column.cast(kind)
        except pa.ArrowException:
            changed = pa.nulls(len(table), kind)
        return table.set_column(place, name, changed), f"{name} is {kind}"
    values = column.to_pylist()
    value = draw(st.sampled_from([*NUMBERS, *TEXTS, LONG_TEXT, None]))
    if draw(st.booleans()):
        values = [value] * len(values)
    elif values:
        values[draw(st.integers(0, len(values) - 1))] = value
    try:
        changed = pa.array(values, column.type)
    except (pa.ArrowException, OverflowError, ValueError, TypeError):
        reject()
    return table.set_column(place, name, changed), f"{name} = {value!r:.40}"


@st.composite
def edited_parquet(draw: st.DrawFn, data: bytes) -> tuple[bytes, str]:
    """A Parquet file with another table in it, written otherwise, or with other bytes."""
    kind = draw(st.sampled_from(["columns"] * 5 + ["rows", "rows", "rows", "empty", "bytes", "bytes"]))
    if kind == "bytes":
        return draw(edited_bytes(data))
    table, notes = read(data), []
    if kind == "columns":
        for _ in range(draw(st.integers(1, 2))):
            if table.num_columns:
                table, note = draw(edited_columns(table))
                notes.append(note)
    elif kind == "empty" or not len(table):
        table, notes = table.slice(0, 0), ["no rows"]
    else:
        count = draw(st.sampled_from(ROWS))
        return bomb(data, count), f"{count} equal rows"
    options = {
        "compression": draw(st.sampled_from(["snappy", "zstd", "gzip", "none"])),
        "use_dictionary": draw(st.booleans()),
        "row_group_size": draw(st.sampled_from([1, 10, None])),
        "version": draw(st.sampled_from(["1.0", "2.6"])),
    }
    try:
        return written(table, **options), "; ".join(notes)
    except (pa.ArrowException, ValueError):
        reject()


@lru_cache(8)
def bomb(data: bytes, count: int) -> bytes:
    """So many times the first row of a file."""
    return repeated(read(data), count)


def repeated(table: pa.Table, count: int) -> bytes:
    """So many times its first row, in kilobytes: written a group of rows at a time, each of runs alone."""
    if count < 10_000:
        return written(table.take(np.zeros(count, np.int64)), compression="zstd")
    block = 1_000_000 if count > 1_000_000 else count
    rows = table.take(np.zeros(1000, np.int64))
    rows = pa.concat_tables([rows] * (block // 1000)).combine_chunks()
    stream = io.BytesIO()
    with pq.ParquetWriter(stream, table.schema, compression="zstd", use_dictionary=True) as writer:
        for _ in range(count // block):
            writer.write_table(rows, row_group_size=block)
    return stream.getvalue()
