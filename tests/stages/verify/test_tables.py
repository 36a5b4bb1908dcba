"""Parquet of others: a bomb costs one line, and no memory; other tables come out as pyarrow reads them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.verify.tables import BATCH_ROWS, MOST_ROWS, rows

READ = """
import resource, sys
from pathlib import Path
from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.verify.tables import rows
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
try:
    for row in rows(Path(sys.argv[1])):
        pass
except AdvpipeError as error:
    print(error)
"""


def test_rows_are_those_of_pyarrow(tmp_path: Path) -> None:
    table = pa.table(
        {
            "text": pa.array(["a", None, "größe"] * 9000),
            "word": pa.array(["x", "y", None] * 9000).dictionary_encode(),
            "number": pa.array([1.5, None, 3.0] * 9000),
            "yes": pa.array([True, False, None] * 9000),
        }
    )
    assert table.num_rows > BATCH_ROWS
    pq.write_table(table, tmp_path / "a.parquet")
    assert list(rows(tmp_path / "a.parquet")) == table.to_pylist()
    assert list(rows(tmp_path / "a.parquet", ["word"])) == table.select(["word"]).to_pylist()


@pytest.mark.parametrize(
    ("column", "reason"),
    [
        (pa.DictionaryArray.from_arrays(np.zeros(1 << 14, np.int32), ["x" * (1 << 20)]), "a text of 1048576"),
        (pa.DictionaryArray.from_arrays(np.zeros(MOST_ROWS + 1, np.int32), ["x"]), "more than 4194304 rows"),
        (pa.array([[["x"]]]), "neither numbers nor texts"),
    ],
)
def test_bombs(tmp_path: Path, column: pa.Array, reason: str) -> None:
    """The first is 16 GiB of text in 46 kB."""
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({"a": column}), path, compression="zstd", store_schema=False)
    assert path.stat().st_size < 100_000
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, check=False)
    assert reason in done.stdout, done.stderr


@pytest.mark.parametrize("length", [0, 3, 100, 300])
def test_what_is_cut_off(tmp_path: Path, length: int) -> None:
    pq.write_table(pa.table({"a": [1, 2]}), tmp_path / "a.parquet")
    data = (tmp_path / "a.parquet").read_bytes()
    (tmp_path / "a.parquet").write_bytes(data[:length])
    with pytest.raises(AdvpipeError, match="no whole Parquet table"):
        list(rows(tmp_path / "a.parquet"))
