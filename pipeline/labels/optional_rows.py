"""Rows of a table of labels that a bag may have beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.bounded_parquet import ColumnType, rows
from advpipe.pipeline.core.errors import AdvpipeError


def optional_rows(
    bag: Path, file: str, columns: Mapping[str, ColumnType], what: str
) -> Iterator[dict[str, Any]]:
    """These columns of a bag's table; none for a bag without it.

    bag: its folder, or the file in it. what: whose labels they are. Raises AdvpipeError for a file that holds
    no such labels.
    """
    path = (bag if bag.is_dir() else bag.parent) / file
    if not path.exists():
        return
    try:
        yield from rows(path, columns)
    except AdvpipeError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise AdvpipeError(f"{path} holds no {what} labels: {reason}; attack again") from None
