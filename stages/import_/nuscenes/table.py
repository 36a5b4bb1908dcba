"""nuScenes' tables: JSON arrays of records, read one record at a time."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from advpipe.pipeline.core.document import Document, validated
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.plain_values import refuse_unsafe_strings

Record = dict[str, Any]
Model = TypeVar("Model", bound=Document)

HINT = "is this a table of nuScenes v1.0?"
_CHUNK = 1 << 20
_LONGEST_RECORD = 1 << 22
_BETWEEN = re.compile(r"[\s,]*")


def read_records(file: Path) -> Iterator[Record]:
    """The records of a table of any size, such as the gigabyte of `sample_annotation.json`.

    Memory holds some megabytes. Raises AdvpipeError for a file that is not an array of objects.
    """
    decoder = json.JSONDecoder()
    try:
        with file.open(encoding="utf-8") as stream:
            text = stream.read(_CHUNK).lstrip("\ufeff \t\r\n")
            if not text.startswith("["):
                raise AdvpipeError(f"{file} does not begin with '[', as an array of records does; {HINT}")
            place = 1
            while True:
                place = _skipped(text, place)
                if text.startswith("]", place):
                    return
                try:
                    record, end = decoder.raw_decode(text, place)
                except json.JSONDecodeError as error:
                    more = stream.read(_CHUNK) if len(text) - place <= _LONGEST_RECORD else ""
                    if not more:
                        raise AdvpipeError(f"{file}: {_damage(text, place, error)}; {HINT}") from None
                    text, place = text[place:] + more, 0
                    continue
                if not isinstance(record, dict):
                    raise AdvpipeError(f"{file} holds {record!r:.40} in place of a record; {HINT}")
                yield record
                place = end
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise AdvpipeError(f"{file} is not a UTF-8 text file") from None
    except RecursionError:
        raise AdvpipeError(f"{file} is nested too deep; {HINT}") from None


def records_of(
    file: Path, model: type[Model], wanted: Callable[[Record], bool] = lambda record: True
) -> Iterator[Model]:
    """The wanted records, validated. Raises AdvpipeError that names the table and the wrong key."""
    for record in read_records(file):
        if wanted(record):
            try:
                refuse_unsafe_strings(record)
            except ValueError as error:
                raise AdvpipeError(f"{file}: {error}; {HINT}") from None
            yield validated(record, model, f"{file}: record {str(record.get('token'))[:40]!r}", HINT)


def has_value(key: str, values: Iterable[str]) -> Callable[[Record], bool]:
    """Whether a record's key has one of these values."""
    values = frozenset(values)

    def is_wanted(record: Record) -> bool:
        value = record.get(key)
        return isinstance(value, str) and value in values

    return is_wanted


def _skipped(text: str, place: int) -> int:
    found = _BETWEEN.match(text, place)
    return found.end() if found else place


def _damage(text: str, place: int, error: json.JSONDecodeError) -> str:
    if len(text) - place > _LONGEST_RECORD:
        return f"a record of more than {_LONGEST_RECORD} characters"
    if error.pos >= len(text) - 1 or not text[place:].strip():
        return "the file is truncated"
    return f"not valid JSON ({error.msg})"
