"""nuScenes' tables as files that grow record by record."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

Record = dict[str, Any]

GROWING = ("sample", "sample_data", "ego_pose", "sample_annotation", "instance")
"""Tables whose length follows that of the drive."""


def token_of(*parts: object) -> str:
    """A token, 32 hexadecimal digits as nuScenes has them; the same for the same parts."""
    return hashlib.sha256("/".join(map(str, parts)).encode()).hexdigest()[:32]


class TableWriter:
    """A folder of tables; records of `GROWING` are written as they come, so that memory stays flat."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True)
        self._files = {name: (folder / f"{name}.json").open("w", encoding="utf-8") for name in GROWING}
        self._is_first = dict.fromkeys(GROWING, True)

    def add(self, table: str, record: Record) -> None:
        """Append a record to a table of `GROWING`."""
        self._files[table].write("[\n" if self._is_first[table] else ",\n")
        self._files[table].write(json.dumps(record))
        self._is_first[table] = False

    def write(self, tables: Mapping[str, list[Record]]) -> None:
        """Write whole tables."""
        for name, records in tables.items():
            text = ",\n".join(map(json.dumps, records))
            (self._folder / f"{name}.json").write_text(f"[\n{text}\n]\n", encoding="utf-8")

    def __enter__(self) -> TableWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for name, file in self._files.items():
            file.write("[]\n" if self._is_first[name] else "\n]\n")
            file.close()
