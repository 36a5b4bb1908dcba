"""Parquet files of others, read within bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.errors import AdvpipeError

GROUP_LIMIT_BYTES = 1 << 30
"""The most that one group of rows may declare to hold; rows are unpacked a batch at a time."""

BATCH_ROWS = 1 << 14


def rows(path: Path, columns: Sequence[str] | None = None) -> Iterator[dict[str, Any]]:
    """The rows of a table, in its order."""
    for batch in batches(path, columns):
        yield from batch.to_pylist()


def batches(path: Path, columns: Sequence[str] | None = None) -> Iterator[Any]:
    """Record batches of at most `BATCH_ROWS` rows. Raises AdvpipeError for a file that is no whole table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(str(path), page_checksum_verification=True) as table:
            for index in range(table.num_row_groups):
                size = table.metadata.row_group(index).total_byte_size
                if not 0 <= size <= GROUP_LIMIT_BYTES:
                    raise AdvpipeError(f"{path}: a group of rows declares {size} bytes, too many to read")
            yield from table.iter_batches(BATCH_ROWS, columns=list(columns) if columns else None)
    except (OSError, pa.ArrowException, ValueError, KeyError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise AdvpipeError(f"{path}: no whole Parquet table ({reason})") from None
