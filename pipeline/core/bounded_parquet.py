"""A bounded reader of untrusted Parquet files.

The decompressed size of a file is known before any of it is decompressed. The footer states the number of
rows, which is bounded in proportion to the file's bytes, since run-length encoding stores a billion equal
rows in as many bytes as one. The header of each page states its bytes, since a footer may be false. Rows are
then read batch by batch.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.parquet_pages import ENCODINGS, Chunk, Page, column_chunks, pages
from advpipe.pipeline.core.remote_path import RemotePath

ColumnType = Literal["whole", "truth", "text"]
COLUMN_TYPES: dict[ColumnType, str] = {
    "whole": "a whole number",
    "truth": "true or false",
    "text": "a string",
}

BATCH_ROWS = 1 << 12
ROWS_AT_ONCE = 1 << 9
"""Rows that are converted to Python objects together; these take some twenty times the memory."""

READ_BYTES = 1 << 16
"""Bytes of a column that are read together: without this limit, a row group's whole column is read."""

LONGEST_TEXT_BYTES = 1 << 11
"""Bytes of one string. A file stores equal strings once: a million rows of a long one take few kilobytes."""

FOOTER_LIMIT_BYTES = 1 << 22
MOST_COLUMNS, MOST_GROUPS = 1000, 10_000
"""A footer is read as a whole, and takes some ten times its bytes in memory."""

MOST_PAGES = 1 << 17
"""Pages of all columns that are read. Writers make pages of about a megabyte, or of 20,000 rows."""

PAGES_LIMIT_BYTES = 1 << 28
"""Decompressed bytes of the largest pages of all columns together: one page of each column is in memory."""

FREE_BATCH_ROWS = 1 << 22
BATCH_ROWS_PER_BYTE = 1
"""Rows of points: each takes at least one byte."""

FREE_ROWS = 100_000
ROWS_PER_BYTE = 1 / 8
"""Rows of messages, fixes and frames hold several numbers each; as Python objects they are slow."""


def rows(
    path: Path, columns: Sequence[str] | Mapping[str, ColumnType] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table in order, each a mapping from column name to value.

    columns and errors: as in `batches`, with a lower limit of rows.
    """
    for batch in batches(path, columns, most_rows=FREE_ROWS + int(ROWS_PER_BYTE * _size(path))):
        for start in range(0, batch.num_rows, ROWS_AT_ONCE):
            yield from batch.slice(start, ROWS_AT_ONCE).to_pylist()


def flat_columns(path: Path) -> set[str]:
    """The names of the columns with numbers or strings. Raises AdvpipeError for a file that is no table."""
    with _opened(path) as table:
        return {field.name for field in table.schema_arrow if _is_number(field.type) or _is_text(field.type)}


def batches(
    path: Path,
    columns: Sequence[str] | Mapping[str, ColumnType] | None = None,
    *,
    most_rows: int | None = None,
) -> Iterator[Any]:
    """Yield `pyarrow.RecordBatch` of at most `BATCH_ROWS` rows, with columns of numbers and strings.

    columns: names, or a mapping from name to the type that every row must have; all columns by default.
    most_rows: the limit of rows, by default in proportion to the file's bytes. Raises AdvpipeError for a file
    that is not a complete table, lacks a column, has a column of another type, or would decompress to more
    than is read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    with _opened(path) as table:
        names = list(columns or table.schema_arrow.names)
        texts = [field.name for field in table.schema_arrow if _is_text(field.type)]
        _check(path, table, names, most_rows)
    try:
        with pq.ParquetFile(
            _file(path), page_checksum_verification=True, read_dictionary=texts, buffer_size=READ_BYTES
        ) as table:
            for batch in table.iter_batches(BATCH_ROWS, columns=names, use_threads=False):
                columns_decoded = [_decoded(path, name, batch.column(name)) for name in names]
                for name, column_type in columns.items() if isinstance(columns, Mapping) else ():
                    _check_type(path, name, batch.column(name), column_type)
                decoded = pa.RecordBatch.from_arrays(columns_decoded, names=names)
                decoded.validate(full=True)  # strings are UTF-8
                yield decoded
    except (OSError, pa.ArrowException, ValueError, KeyError, MemoryError) as error:
        raise _no_table(path, error) from None


def _opened(path: Path) -> Any:
    """The table with its footer read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        length, magic = _end(path)
        if magic == b"PAR1" and length > FOOTER_LIMIT_BYTES:
            raise AdvpipeError(f"{path}: the Parquet footer has {length} bytes, more than are read")
        return pq.ParquetFile(_file(path))
    except (OSError, pa.ArrowException, ValueError) as error:
        raise _no_table(path, error) from None


def _end(path: Path) -> tuple[int, bytes]:
    """The length of the footer, and the file's last four bytes."""
    with path.open("rb") as file:
        file.seek(max(_size(path) - 8, 0))
        end = file.read(8)
    return int.from_bytes(end[:4], "little"), end[4:]


def _column_chunks(path: Path) -> list[list[Chunk]]:
    try:
        length, _ = _end(path)
        with path.open("rb") as file:
            file.seek(max(_size(path) - 8 - length, 0))
            return column_chunks(file.read(length))
    except (ValueError, OSError) as error:
        raise _no_table(path, error) from None


def _file(path: Path) -> Any:
    """The file for pyarrow, which takes names that are not UTF-8 only as bytes."""
    import pyarrow as pa

    return path.open("rb") if isinstance(path, RemotePath) else pa.OSFile(os.fsencode(path))


def _check(path: Path, table: Any, names: Sequence[str], most_rows: int | None) -> None:
    metadata, known = table.metadata, table.schema_arrow.names
    if len(set(known)) < len(known):
        raise AdvpipeError(f"{path}: two columns have the same name")
    if missing := [name for name in names if name not in known]:
        raise AdvpipeError(f"{path}: no column {missing[0]}")
    if metadata.num_columns > MOST_COLUMNS or metadata.num_row_groups > MOST_GROUPS:
        raise AdvpipeError(
            f"{path}: {metadata.num_columns} columns in {metadata.num_row_groups} row groups, "
            "more than are read"
        )
    groups = [metadata.row_group(index) for index in range(metadata.num_row_groups)]
    count = max(metadata.num_rows, sum(group.num_rows for group in groups))
    if most_rows is None:
        most_rows = FREE_BATCH_ROWS + BATCH_ROWS_PER_BYTE * _size(path)
    if not 0 <= count <= most_rows or any(group.num_rows < 0 for group in groups):
        raise AdvpipeError(f"{path}: {count} rows; at most {most_rows} are read from a file of this size")
    columns = [table.schema.column(index).path for index in range(metadata.num_columns)]
    chunks = _column_chunks(path)
    if any(len(group) != len(columns) for group in chunks) or len(chunks) != len(groups):
        raise AdvpipeError(f"{path}: a row group does not have the table's columns")
    chosen = set(names)  # a dot separates a column from its field, or is a part of its name
    read = {i: column for i, column in enumerate(columns) if {column, column.partition(".")[0]} & chosen}
    _check_pages(path, chunks, read)


def _check_pages(path: Path, groups: Sequence[Sequence[Chunk]], columns: Mapping[int, str]) -> None:
    """Refuse a row group whose dictionaries and largest pages take too much memory together.

    columns: names by index in a row group. Arrow reads by index, whatever names the row group states.
    """
    count = 0
    with path.open("rb") as file:
        for group in groups:
            held_bytes = 0
            for index, column in columns.items():
                dictionary = largest = 0
                for page in _pages(path, file, column, group[index]):
                    dictionary = max(dictionary, page.uncompressed_bytes * page.is_dictionary)
                    largest = max(largest, page.uncompressed_bytes)
                    count += 1
                    if count > MOST_PAGES:
                        raise AdvpipeError(f"{path}: more than {MOST_PAGES} pages; no more are read")
                held_bytes += dictionary + largest
            if held_bytes > PAGES_LIMIT_BYTES:
                raise AdvpipeError(f"{path}: its pages decompress to {held_bytes} bytes, more than are read")


def _pages(path: Path, file: Any, column: str, chunk: Chunk) -> Iterator[Page]:
    try:
        for page in pages(file, chunk.start, chunk.length):
            if page.encoding not in ENCODINGS:
                raise AdvpipeError(
                    f"{path}: {column} has an unsupported encoding; "
                    "write it with plain or dictionary encoding"
                )
            yield page
    except (ValueError, OSError, OverflowError) as error:
        raise _no_table(path, error) from None


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise _no_table(path, error) from None


def _no_table(path: Path, error: BaseException) -> AdvpipeError:
    reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
    return AdvpipeError(f"{path}: not a complete Parquet file ({reason})")


def _is_number(arrow_type: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_primitive(arrow_type))


def _is_text(arrow_type: Any) -> bool:
    import pyarrow as pa

    arrow_type = arrow_type.value_type if pa.types.is_dictionary(arrow_type) else arrow_type
    return bool(pa.types.is_string(arrow_type) or pa.types.is_large_string(arrow_type))


def _check_type(path: Path, name: str, column: Any, column_type: ColumnType) -> None:
    import pyarrow as pa

    has_type = {"whole": pa.types.is_integer, "truth": pa.types.is_boolean, "text": _is_text}[column_type]
    if not has_type(column.type) or column.null_count:
        raise AdvpipeError(f"{path}: {name} must be {COLUMN_TYPES[column_type]} in every row")


def _decoded(path: Path, name: str, column: Any) -> Any:
    """A column with its dictionary decoded, so that each row has its string."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if _is_number(column.type):
        return column
    if not pa.types.is_dictionary(column.type) or not _is_text(column.type):
        raise AdvpipeError(f"{path}: {name} holds neither numbers nor strings")
    longest = pc.max(pc.binary_length(column.dictionary)).as_py() or 0
    if longest > LONGEST_TEXT_BYTES:
        raise AdvpipeError(
            f"{path}: {name} holds a string of {longest} bytes; at most {LONGEST_TEXT_BYTES} are read"
        )
    return column.dictionary_decode()
