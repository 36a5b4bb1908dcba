"""nuScenes' tables: JSON arrays of records, read one record at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from advpipe.pipeline.core.document import Document, validated
from advpipe.pipeline.core.json_array import Record, every_record, read_json_array

Model = TypeVar("Model", bound=Document)

HINT = "is this a table of nuScenes v1.0?"


def records_of(
    file: Path, model: type[Model], wanted: Callable[[Record], bool] = every_record
) -> Iterator[Model]:
    """The wanted records, validated. Raises AdvpipeError that names the table and the wrong key.

    A table may have a gigabyte, such as `sample_annotation.json`: memory holds some megabytes.
    """
    for record in read_json_array(file, HINT, wanted):
        yield validated(record, model, f"{file}: record {str(record.get('token'))[:40]!r}", HINT)


def has_value(key: str, values: Iterable[str]) -> Callable[[Record], bool]:
    """Whether a record's key has one of these values."""
    values = frozenset(values)

    def is_wanted(record: Record) -> bool:
        value = record.get(key)
        return isinstance(value, str) and value in values

    return is_wanted
