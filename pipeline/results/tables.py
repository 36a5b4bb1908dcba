"""The tables of a report as Parquet has them: columns and their types are those of the rows' fields."""

from __future__ import annotations

import types
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import pyarrow as pa

from advpipe.pipeline.results.column import DICTIONARY, INT32
from advpipe.pipeline.results.frame_row import CloudCounts, FrameRow
from advpipe.pipeline.results.listed import key_of
from advpipe.pipeline.results.match_row import MatchRow
from advpipe.pipeline.results.row import ResultRow

_ARROW = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    INT32: pa.int32(),
    DICTIONARY: pa.dictionary(pa.int32(), pa.string()),
}


def match_schema() -> pa.Schema:
    """The columns of `results.parquet`."""
    return pa.schema([(key_of(name), kind) for name, kind in _types(MatchRow).items()])


def match_table(rows: Sequence[MatchRow]) -> pa.Table:
    """Detections and objects of some frames, of all clouds and bags."""
    schema = match_schema()
    columns = [[getattr(row, each.name) for row in rows] for each in fields(MatchRow)]
    return _table(columns, schema)


def frame_table(
    results: Iterable[tuple[ResultRow, Sequence[FrameRow]]], conditions: Sequence[str]
) -> pa.Table:
    """The frames of each result; conditions: those that have columns, empty where a frame lacks one."""
    listed = [(result, row) for result, rows in results for row in rows]
    schema: list[tuple[str, pa.DataType]] = [
        (name, pa.string()) for name in ("bag", "detector", "attack", "recipe")
    ]
    columns: list[list[Any]] = [
        [result.bag for result, _ in listed],
        [result.detector for result, _ in listed],
        [result.attack.attack for result, _ in listed],
        [result.attack.recipe for result, _ in listed],
    ]
    for name, kind in _types(FrameRow).items():
        schema.append((name, kind))
        columns.append([getattr(row, name) for _, row in listed])
    for condition in conditions:
        for name, kind in _types(CloudCounts).items():
            schema.append((f"{name}_{condition}", kind))
            columns.append([row.count(condition, name) for _, row in listed])
    return _table(columns, pa.schema(schema))


def _table(columns: Sequence[list[Any]], schema: pa.Schema) -> pa.Table:
    arrays = [pa.array(values, type=field.type) for values, field in zip(columns, schema, strict=True)]
    return pa.Table.from_arrays(arrays, schema=schema)


def _types(row: type) -> dict[str, pa.DataType]:
    """The fields of a row that are columns, with their types; counts of clouds are columns of their own."""
    hints = get_type_hints(row, include_extras=True)
    return {each.name: _arrow(hints[each.name]) for each in fields(row) if each.name != "clouds"}


def _arrow(hint: Any) -> pa.DataType:
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (each for each in get_args(hint) if each is not type(None))
    return _ARROW[hint.__metadata__[0] if get_origin(hint) is Annotated else hint]
