"""XML of others, looked through before it is held in memory or given to SUMO, which expands every entity."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from advpipe.pipeline.core.errors import AdvpipeError

MOST_BYTES = 1 << 28
"""SUMO's network of a whole city has some 40 MB."""

MOST_ELEMENTS = 3_000_000
"""Each takes some 300 bytes of memory here, and more in SUMO."""

MOST_LEVELS = 100


class _RefusedError(Exception):
    pass


def refuse_xml_bombs(path: Path, what: str) -> None:
    """Raises AdvpipeError, beginning with `what`, for a file that is too large or declares a document type.

    Entities, a few of which can stand for gigabytes, are declared nowhere else. What is no XML passes.
    """
    if path.stat().st_size > MOST_BYTES:
        raise AdvpipeError(f"{what} has {path.stat().st_size} bytes; at most {MOST_BYTES} are read")
    elements = level = 0

    def doctype(*_: object) -> NoReturn:
        raise _RefusedError(
            "declares a document type (<!DOCTYPE>), whose entities may stand for any amount; remove it"
        )

    def start(*_: object) -> None:
        nonlocal elements, level
        elements, level = elements + 1, level + 1
        if elements > MOST_ELEMENTS:
            raise _RefusedError(f"has more than {MOST_ELEMENTS} elements, too many to read")
        if level > MOST_LEVELS:
            raise _RefusedError(f"is nested too deeply: more than {MOST_LEVELS} levels")

    def end(*_: object) -> None:
        nonlocal level
        level -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
    except _RefusedError as error:
        raise AdvpipeError(f"{what} {error}") from None
    except (expat.ExpatError, ValueError, LookupError):  # whoever reads it says so
        return
