"""A table of labels that grows for as long as something runs, in bounded memory."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from advpipe.pipeline.labels.columns import Columns, arrow_schema

GROUP_ROWS = 20_000
"""Rows that are in memory, and a row group of the file: a reader keeps some kilobytes for each group."""


class GrowingTable:
    """Appends rows to a Parquet file, in the order in which they come."""

    def __init__(self, path: Path, columns: Columns) -> None:
        import pyarrow.parquet as pq

        self._schema = arrow_schema(columns)
        self._writer = pq.ParquetWriter(str(path), self._schema)
        self._rows: list[Mapping[str, object]] = []
        self._tables: list[Any] = []
        self._waiting = 0

    def add_row(self, row: Mapping[str, object]) -> None:
        """Append one row."""
        self._rows.append(row)
        if len(self._rows) >= GROUP_ROWS:
            self._close_rows()

    def add_table(self, table: Any) -> None:
        """Append a pyarrow.Table of these columns."""
        self._tables.append(table)
        self._waiting += table.num_rows
        if self._waiting >= GROUP_ROWS:
            self._write()

    def close(self) -> None:
        """Write what is left; the file is whole then."""
        self._close_rows()
        self._write()
        self._writer.close()

    def _close_rows(self) -> None:
        import pyarrow as pa

        if self._rows:
            rows, self._rows = self._rows, []
            self.add_table(pa.Table.from_pylist(rows, self._schema))

    def _write(self) -> None:
        import pyarrow as pa

        if self._tables:
            self._writer.write_table(pa.concat_tables(self._tables))
            self._tables, self._waiting = [], 0
