"""Large untrusted JSON arrays of objects, read one object at a time."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.plain_json import LIMIT_BYTES, load_json

Record = dict[str, Any]

_CHUNK = 1 << 20
_BETWEEN = re.compile(r"[\s,]*")


def every_record(record: Record) -> bool:
    """For `read_json_array` to yield all records."""
    return True


def read_json_array(
    file: Path, hint: str, wanted: Callable[[Record], bool] = every_record
) -> Iterator[Record]:
    """The wanted objects of an array of any size; memory holds some megabytes.

    Wanted objects pass through `plain_json`, whose bounds hold for each. hint: for errors, what the file
    should be. Raises AdvpipeError, one line, for a file that is not an array of objects.
    """
    try:
        with file.open(encoding="utf-8") as stream:
            yield from _records(iter(lambda: stream.read(_CHUNK), ""), str(file), hint, wanted)
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise AdvpipeError(f"{file} is not a UTF-8 text file") from None
    except RecursionError:
        raise AdvpipeError(f"{file} is nested too deep; {hint}") from None


def _records(
    chunks: Iterator[str], where: str, hint: str, wanted: Callable[[Record], bool]
) -> Iterator[Record]:
    decoder = json.JSONDecoder()
    text = next(chunks, "").lstrip("\ufeff \t\r\n")
    if not text.startswith("["):
        raise AdvpipeError(f"{where} does not begin with '[', as an array of records does; {hint}")
    place = 1
    while True:
        between = _BETWEEN.match(text, place)
        place = between.end() if between else place
        if text.startswith("]", place):
            return
        try:
            record, end = decoder.raw_decode(text, place)
        except ValueError as error:
            more = next(chunks, "") if len(text) - place <= LIMIT_BYTES else ""
            if not more:
                raise AdvpipeError(f"{where}: {_damage(text, place, error)}; {hint}") from None
            text, place = text[place:] + more, 0
            continue
        if not isinstance(record, dict):
            raise AdvpipeError(f"{where} holds {record!r:.40} in place of a record; {hint}")
        if wanted(record):
            try:
                yield load_json(text[place:end])
            except ValueError as error:
                raise AdvpipeError(f"{where}: not valid JSON: {error}; {hint}") from None
        place = end


def _damage(text: str, place: int, error: ValueError) -> str:
    if len(text) - place > LIMIT_BYTES:
        return f"a record of more than {LIMIT_BYTES} characters"
    if isinstance(error, json.JSONDecodeError):
        if error.pos >= len(text) - 1 or error.msg.startswith("Unterminated"):
            return "the file is truncated"
        return f"not valid JSON ({error.msg})"
    return f"not valid JSON ({str(error).splitlines()[0]:.80})"
