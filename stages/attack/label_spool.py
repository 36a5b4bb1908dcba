"""Labels on their way into a file: a long drive has more than memory should hold."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.labels.columns import Columns, arrow_schema

BATCH = 4096
IN_MEMORY_BYTES = 1 << 22


class LabelSpool:
    """A table of labels in a temporary file. actions: how many rows of each."""

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self.actions: Counter[str] = Counter()
        self._waiting: list[Mapping[str, object]] = []
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY_BYTES)  # noqa: SIM115  # closed by copy_to
        self._writer: Any = None

    def add(self, rows: Sequence[Mapping[str, object]]) -> None:
        """Append rows."""
        self.actions.update(str(row["action"]) for row in rows)
        self._waiting += rows
        if len(self._waiting) >= BATCH:
            self._flush()

    def copy_to(self, path: Path) -> None:
        """Write the whole table as a Parquet file; nothing can be added afterwards."""
        self._flush()
        self._writer.close()
        self._file.seek(0)
        with path.open("wb") as file, self._file:
            shutil.copyfileobj(self._file, file)

    def _flush(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema = arrow_schema(self._columns)
        if self._writer is None:
            self._writer = pq.ParquetWriter(pa.PythonFile(self._file, "w"), schema)
        self._writer.write_table(pa.Table.from_pylist(self._waiting, schema))
        self._waiting = []
