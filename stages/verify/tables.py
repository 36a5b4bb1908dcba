"""Parquet files of others, read within bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.errors import AdvpipeError

GROUP_LIMIT_BYTES = 1 << 30
"""The most that one group of rows may declare to hold; rows are unpacked a batch at a time."""

BATCH_ROWS = 1 << 12
ROWS_AT_ONCE = 1 << 9
"""As Python's own values, which take some twenty times as much."""

READ_BYTES = 1 << 16
"""Of a column at once: without it, all of it is read that a group of rows holds."""

LONGEST_TEXT_BYTES = 1 << 12
"""Of a text in a cell. Files keep equal texts once: a million rows of a long one lie in a few kilobytes."""

MOST_ROWS = 1 << 22
"""The most that `rows` reads, for the same reason."""


def rows(path: Path, columns: Sequence[str] | None = None) -> Iterator[dict[str, Any]]:
    """The rows of a table, in its order."""
    count = 0
    for batch in batches(path, columns):
        count += batch.num_rows
        if count > MOST_ROWS:
            raise AdvpipeError(f"{path}: more than {MOST_ROWS} rows, too many to read")
        for start in range(0, batch.num_rows, ROWS_AT_ONCE):
            yield from batch.slice(start, ROWS_AT_ONCE).to_pylist()


def flat_columns(path: Path) -> set[str]:
    """Names of the columns that hold numbers or texts; raises AdvpipeError for a file that is no table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        fields = list(pq.read_schema(str(path)))
    except (OSError, pa.ArrowException, ValueError) as error:
        raise _no_table(path, error) from None
    return {field.name for field in fields if pa.types.is_primitive(field.type) or _is_text(field.type)}


def batches(path: Path, columns: Sequence[str] | None = None) -> Iterator[Any]:
    """Record batches of at most `BATCH_ROWS` rows, of numbers and texts.

    Raises AdvpipeError for a file that is no whole table, and for one with other columns.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(str(path)) as table:
            names = list(columns or table.schema_arrow.names)
            texts = [field.name for field in table.schema_arrow if pa.types.is_string(field.type)]
        with pq.ParquetFile(
            str(path), page_checksum_verification=True, read_dictionary=texts, buffer_size=READ_BYTES
        ) as table:
            for index in range(table.num_row_groups):
                size = table.metadata.row_group(index).total_byte_size
                if not 0 <= size <= GROUP_LIMIT_BYTES:
                    raise AdvpipeError(f"{path}: a group of rows declares {size} bytes, too many to read")
            for batch in table.iter_batches(BATCH_ROWS, columns=names):
                unpacked = [_unpacked(path, name, batch.column(name)) for name in names]
                yield pa.RecordBatch.from_arrays(unpacked, names=names)
    except (OSError, pa.ArrowException, ValueError, KeyError) as error:
        raise _no_table(path, error) from None


def _no_table(path: Path, error: Exception) -> AdvpipeError:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return AdvpipeError(f"{path}: no whole Parquet table ({reason})")


def _is_text(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_string(kind.value_type if pa.types.is_dictionary(kind) else kind))


def _unpacked(path: Path, name: str, column: Any) -> Any:
    """A column with its texts in each row; equal ones were read once."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_primitive(column.type):
        return column
    if not pa.types.is_dictionary(column.type) or not pa.types.is_string(column.type.value_type):
        raise AdvpipeError(f"{path}: {name} holds neither numbers nor texts")
    longest = pc.max(pc.binary_length(column.dictionary)).as_py() or 0
    if longest > LONGEST_TEXT_BYTES:
        raise AdvpipeError(f"{path}: {name} holds a text of {longest} bytes, too many to read")
    return column.dictionary_decode()
