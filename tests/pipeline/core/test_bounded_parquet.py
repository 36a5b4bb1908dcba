"""Untrusted Parquet: bombs fail with one line in little memory; valid tables are read as by pyarrow."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.core.bounded_parquet import BATCH_ROWS, FREE_ROWS, batches, rows
from advpipe.pipeline.core.errors import AdvpipeError

READ = """
import resource, sys
from pathlib import Path
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.bounded_parquet import rows
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
try:
    for row in rows(Path(sys.argv[1])):
        pass
except AdvpipeError as error:
    print(error)
"""


def test_rows_equal_those_of_pyarrow(tmp_path: Path) -> None:
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


def test_a_file_name_that_is_not_utf8_is_read(tmp_path: Path) -> None:
    table = pa.table({"text": ["a"], "number": [1]})
    pq.write_table(table, tmp_path / "a.parquet")
    odd = tmp_path / os.fsdecode(b"\xff.parquet")
    (tmp_path / "a.parquet").rename(odd)
    assert list(rows(odd)) == table.to_pylist()


@pytest.mark.parametrize(
    ("column", "reason"),
    [
        (pa.DictionaryArray.from_arrays(np.zeros(1 << 14, np.int32), ["x" * (1 << 20)]), "string of 1048576"),
        (
            pa.DictionaryArray.from_arrays(np.zeros(FREE_ROWS + 50_000, np.int32), ["x"]),
            "150000 rows; at most",
        ),
        (pa.array([[["x"]]]), "neither numbers nor strings"),
    ],
)
def test_decompression_bombs_are_refused(tmp_path: Path, column: pa.Array, reason: str) -> None:
    """The first is 16 GiB of text in 46 kB."""
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({"a": column}), path, compression="zstd", store_schema=False)
    assert path.stat().st_size < 100_000
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, check=False)
    assert reason in done.stdout, done.stderr


@pytest.mark.parametrize("length", [0, 3, 100, 300])
def test_truncated_files_are_refused(tmp_path: Path, length: int) -> None:
    pq.write_table(pa.table({"a": [1, 2]}), tmp_path / "a.parquet")
    data = (tmp_path / "a.parquet").read_bytes()
    (tmp_path / "a.parquet").write_bytes(data[:length])
    with pytest.raises(AdvpipeError, match="not a complete Parquet file"):
        list(rows(tmp_path / "a.parquet"))


MEASURE = """
import sys, time
from pathlib import Path
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.bounded_parquet import batches
import pyarrow.parquet
def peak_kib():  # that of `resource` is at least what the process that started this one held
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
before, start = peak_kib(), time.process_time()
try:
    print(sum(batch.num_rows for batch in batches(Path(sys.argv[1]))))
except AdvpipeError as error:
    print(error)
peak_mib = (peak_kib() - before) >> 10
print(f"{peak_mib < 100} {time.process_time() - start < 10}: {peak_mib} MiB")
"""


def measured(path: Path) -> str:
    """What reading comes to, and whether it took less than 100 MiB and ten seconds."""
    done = subprocess.run([sys.executable, "-c", MEASURE, path], capture_output=True, text=True, check=True)
    return done.stdout


def equal_rows(path: Path, count: int) -> None:
    """So many equal rows, of which run lengths make some hundred bytes a million."""
    columns = {"word": pa.array(["x"]), "number": pa.array([7])}
    schema = pa.schema([(name, pa.dictionary(pa.int32(), column.type)) for name, column in columns.items()])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        codes = np.zeros(1 << 20, np.int32)
        for start in range(0, count, 1 << 20):
            own = codes[: count - start]
            arrays = [pa.DictionaryArray.from_arrays(own, column) for column in columns.values()]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def test_a_hundred_million_rows_in_a_small_file_are_refused_quickly(tmp_path: Path) -> None:
    equal_rows(tmp_path / "a.parquet", 100_000_000)
    assert (tmp_path / "a.parquet").stat().st_size < 2_000_000
    found = measured(tmp_path / "a.parquet")
    assert "100000000 rows; at most" in found
    assert "True True" in found, found


def varint(number: int, length: int = 0) -> bytes:
    """A signed number as Thrift's compact protocol has it, padded to a length."""
    value, parts = number << 1, list[int]()
    while value or not parts or len(parts) < length:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts[:-1], parts[-1] & 0x7F])


def with_false_count(path: Path, truth: int, false_count: int) -> None:
    """Replaces a number in the footer."""
    data, stated = path.read_bytes(), varint(truth)
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    assert stated in data[footer:]
    path.write_bytes(data[:footer] + data[footer:].replace(stated, varint(false_count, len(stated))))


def renamed_chunks(path: Path, name: bytes, stated: bytes) -> None:
    """Gives a column another name in the one group of rows, and leaves that of the table."""
    before, found, after = path.read_bytes().rpartition(b"\x19\x18" + bytes([len(name)]) + name)
    assert found
    path.write_bytes(before + found.replace(name, stated) + after)


def test_a_row_group_with_other_column_names_is_read_by_index(tmp_path: Path) -> None:
    """Arrow reads columns by their places."""
    table = pa.table({"number": [1, 2], "text": ["a", "b"]})
    pq.write_table(table, tmp_path / "a.parquet", store_schema=False)
    renamed_chunks(tmp_path / "a.parquet", b"number", b"nu\xf3ber")
    assert list(rows(tmp_path / "a.parquet", ["number"])) == table.select(["number"]).to_pylist()


def test_a_footer_that_states_too_few_rows_is_followed_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": np.zeros(3_000_001)}), path, row_group_size=3_000_001)
    with_false_count(path, 3_000_001, 10)
    assert pq.read_metadata(path).num_rows == 10
    found = measured(path)
    assert found.startswith(("10\n", f"{path}: not a complete Parquet file")), found
    assert "True True" in found, found


@pytest.mark.parametrize(
    ("name", "stated"), [("letter", "letter"), ("letter", "better"), ("let.er", "let.er")]
)
def test_a_page_that_decompresses_to_hundreds_of_megabytes_is_refused(
    tmp_path: Path, name: str, stated: str
) -> None:
    """No more rows than the file may have, but of long texts in one page; the footer says otherwise.

    stated: the column's name in the row group.
    """
    path = tmp_path / "a.parquet"
    texts = pa.concat_arrays([pa.array(["x" * 75] * (1 << 18))] * 16)
    options = {"use_dictionary": False, "data_page_size": 1 << 30, "max_rows_per_page": 1 << 30}
    pq.write_table(pa.table({name: texts}), path, compression="zstd", row_group_size=1 << 30, **options)
    assert path.stat().st_size < 200_000
    renamed_chunks(path, name.encode(), stated.encode())
    with_false_count(path, pq.read_metadata(path).row_group(0).column(0).total_uncompressed_size, 1000)
    found = measured(path)
    assert "its pages decompress to" in found, found
    assert "True True" in found, found


@pytest.mark.parametrize("encoding", ["DELTA_BYTE_ARRAY", "DELTA_LENGTH_BYTE_ARRAY"])
def test_delta_encoded_strings_are_refused(tmp_path: Path, encoding: str) -> None:
    """They decode in one step to as many strings as they declare, whatever page and footer declare."""
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": ["x", "xy"]}), path, use_dictionary=False, column_encoding={"a": encoding})
    with pytest.raises(AdvpipeError, match="a has an unsupported encoding"):
        list(batches(path))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"use_dictionary": False},
        {"data_page_version": "2.0"},
        {"compression": "none", "write_page_checksum": True},
        {"compression": "lz4", "row_group_size": 1000},
        {"use_dictionary": False, "column_encoding": {"number": "DELTA_BINARY_PACKED"}},
        {"use_dictionary": False, "column_encoding": {"share": "BYTE_STREAM_SPLIT"}},
        {"data_page_size": 1000, "write_page_index": True},
    ],
    ids=str,
)
def test_tables_of_all_writers_are_read(tmp_path: Path, options: dict[str, Any]) -> None:
    count = 20_000
    table = pa.table(
        {
            "text": pa.array([f"{number % 700}" for number in range(count)], pa.large_string()),
            "number": pa.array(range(count)),
            "share": np.random.default_rng(0).random(count),
        }
    )
    pq.write_table(table, tmp_path / "a.parquet", **options)
    assert list(rows(tmp_path / "a.parquet")) == table.to_pylist()


def test_an_error_names_a_column_of_another_type(tmp_path: Path) -> None:
    pq.write_table(pa.table({"a": [1, None], "b": ["x", "y"]}), tmp_path / "a.parquet")
    with pytest.raises(AdvpipeError, match="a must be a whole number in every row"):
        list(rows(tmp_path / "a.parquet", {"a": "whole"}))
    with pytest.raises(AdvpipeError, match="b must be true or false in every row"):
        list(rows(tmp_path / "a.parquet", {"b": "truth"}))
    assert [*rows(tmp_path / "a.parquet", {"b": "text"})] == [{"b": "x"}, {"b": "y"}]
    with pytest.raises(AdvpipeError, match="no column c"):
        list(rows(tmp_path / "a.parquet", ["c"]))


def test_a_long_footer_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(100) + (1 << 30).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(AdvpipeError, match="the Parquet footer has 1073741824 bytes"):
        list(rows(tmp_path / "a.parquet"))


def test_a_table_without_rows_is_read(tmp_path: Path) -> None:
    """Its only group has a dictionary page for texts, and no data page."""
    path = tmp_path / "empty.parquet"
    schema = pa.schema([("a", pa.int64()), ("b", pa.string())])
    pq.write_table(schema.empty_table(), path)
    assert list(rows(path, ["a", "b"])) == []


FLIPPED = """
import sys
from pathlib import Path
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.core.errors import AdvpipeError
path = Path(sys.argv[1])
whole = path.read_bytes()
footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
refused = 0
for bit in range(8 * footer, 8 * (len(whole) - 8), int(sys.argv[2])):
    data = bytearray(whole)
    data[bit // 8] ^= 1 << bit % 8
    path.write_bytes(data)
    try:
        list(rows(path))
    except AdvpipeError:
        refused += 1
print(refused)
"""


@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.nightly)])
def test_no_flipped_bit_in_a_footer_crashes_the_process(tmp_path: Path, every: int) -> None:
    """Such as one that makes a column's levels or encryption inconsistent with the rest."""
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"name": ["a", "b"], "x_m": [1.0, 2.0]}), path)
    command = [sys.executable, "-c", FLIPPED, str(path), str(every)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) > 1000 / every


def test_strings_that_are_not_utf8_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"name": ["sedan", "estate"]}), path, compression="none")
    path.write_bytes(path.read_bytes().replace(b"sedan", b"s\xe7dan"))
    with pytest.raises(AdvpipeError, match="not a complete Parquet file"):
        list(rows(path))
