"""A table that grows in bounded memory."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.labels.columns import Columns, arrow_schema
from advpipe.pipeline.labels.growing_table import GROUP_ROWS, GrowingTable

COLUMNS: Columns = {"number": "int64", "word": "string"}


def test_rows_and_tables_in_their_order_and_few_groups(tmp_path: Path) -> None:
    table = GrowingTable(tmp_path / "table.parquet", COLUMNS)
    for number in range(2 * GROUP_ROWS + 5):
        table.add_row({"number": number, "word": "row"})
    table.close()
    found = pq.read_table(tmp_path / "table.parquet")
    assert found["number"].to_pylist() == list(range(2 * GROUP_ROWS + 5))
    assert pq.ParquetFile(tmp_path / "table.parquet").metadata.num_row_groups == 3


def test_small_tables_share_a_group(tmp_path: Path) -> None:
    table = GrowingTable(tmp_path / "table.parquet", COLUMNS)
    for number in range(3):
        table.add_table(pa.Table.from_pylist([{"number": number, "word": ""}], arrow_schema(COLUMNS)))
    table.close()
    assert pq.ParquetFile(tmp_path / "table.parquet").metadata.num_row_groups == 1
    assert pq.read_table(tmp_path / "table.parquet")["number"].to_pylist() == [0, 1, 2]


def test_an_empty_one_has_its_columns(tmp_path: Path) -> None:
    GrowingTable(tmp_path / "table.parquet", COLUMNS).close()
    assert pq.read_table(tmp_path / "table.parquet").column_names == ["number", "word"]
