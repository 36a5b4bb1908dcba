"""Bombs and false lengths in MCAP files: each fails with one error, in little memory and time."""

from __future__ import annotations

import os
import resource
import struct
import subprocess
import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core import plain_yaml
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.reader import DAMAGE
from advpipe.pipeline.mcap.records import (
    CHUNK_LIMIT_BYTES,
    HEAD,
    inner_records,
    parse_chunk,
    parse_message_index,
    read_records,
    unpack_chunk,
)
from advpipe.pipeline.messages.types import schema_text

ZEROS = 64 << 20
Packer = Callable[[bytes], bytes]
PACKERS: dict[str, Packer] = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}


def chunk(compression: str, data: bytes, size: int) -> Chunk:
    return Chunk(compression, data, 0, 0, 0, size)


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_a_chunk_is_decompressed_completely(compression: str) -> None:
    data = np.random.default_rng(1).bytes(100_000)
    packed = PACKERS[compression](data) if compression else data
    assert unpack_chunk(chunk(compression, packed, len(data))) == data


@pytest.mark.parametrize("size", [0, 1, 1000, ZEROS - 1, ZEROS + 1, CHUNK_LIMIT_BYTES, 2**63])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "zstd without size", "brotli", ""])
def test_a_decompression_bomb_is_refused(compression: str, size: int) -> None:
    """64 MiB of zeros in some kilobytes, whatever the chunk declares."""
    name = compression.split()[0] if compression else ""
    if compression == "zstd without size":
        packed = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(ZEROS))
    else:
        packed = PACKERS.get(name, lambda data: data[:1])(bytes(ZEROS))
    if (name, size) != ("", 1):
        with pytest.raises(DAMAGE):
            unpack_chunk(chunk(name, packed, size))


def test_a_frame_that_declares_a_false_size_is_refused() -> None:
    """zstd's own header declares 2^62 bytes, which the codec would set aside."""
    packed = bytearray(zstandard.compress(bytes(1000)))
    assert zstandard.frame_content_size(bytes(packed)) == 1000
    false_size = packed[:4] + bytes([0xC0 | packed[4] & 0x3F]) + struct.pack("<Q", 2**62) + packed[7:]
    for declared in (1000, 2**62):
        with pytest.raises(DAMAGE):
            unpack_chunk(chunk("zstd", bytes(false_size), declared))


@pytest.mark.parametrize("length", [1, 2**31, 2**40, 2**64 - 1])
def test_a_record_longer_than_the_file_is_not_read(length: int) -> None:
    data = HEAD.pack(1, length)
    with pytest.raises(ValueError, match="past the end"):
        next(read_records(BytesIO(data), 0, len(data)))
    with pytest.raises(ValueError, match="are left"):
        list(inner_records(data))


def test_false_lengths_within_records_are_refused() -> None:
    with pytest.raises(ValueError, match="declares 9 bytes of data"):
        parse_chunk(struct.pack("<QQQIIQ", 0, 0, 0, 0, 0, 9) + b"12345678")
    with pytest.raises(ValueError, match="extends past its end"):
        parse_chunk(struct.pack("<QQQIIQ", 0, 0, 0, 0, 2**32 - 1, 0))
    with pytest.raises(ValueError, match="message index declares"):
        parse_message_index(struct.pack("<HI", 1, 2**32 - 16))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a/msg/B\nimport os", "int8 x"),
        ("a/msg/B(object): pass #", "int8 x"),
        ("a/msg/B", "string[4097] x"),
        ("a/msg/B", f"string[2000] x\na/C[2097] y\n{'=' * 80}\nMSG: a/C\nint8 z"),
        ("a/msg/B", f"int8 x # {'x' * (1 << 20)}"),
    ],
)
def test_a_type_name_that_would_become_code_is_refused(tmp_path: Path, name: str, text: str) -> None:
    """rosbags makes Python of the bag's definitions: their names are names, their arrays short."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "other")
        schema = writer.register_schema(name, "ros2msg", text.encode())
        channel = writer.register_channel("/a", "cdr", schema)
        writer.add_message(channel, 0, b"\0\1\0\0\0", 0)
        writer.finish()
    with pytest.raises(AdvpipeError):
        list(BagReader(path).messages("/a"))


def test_a_long_metadata_record_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "other")
        writer.add_metadata("advpipe", {"attacks": "[" + "[]," * (6 << 20) + "[]]"})
        writer.finish()
    with pytest.raises(AdvpipeError, match="metadata record at"):
        BagReader(path)


def test_yaml_bombs_are_refused() -> None:
    nine = "\n".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10))
    merge = "a: &a {x: 1}\n" + "\n".join(f"b{i}: &b{i} {{<<: [*a, *a]}}" for i in range(9))
    for text in (f"a0: &a0 [x]\n{nine}", merge, "[" * 100_000, "x" * (5 << 20)):
        with pytest.raises((yaml.YAMLError, ValueError, RecursionError)):
            plain_yaml.load_yaml(text)
    assert plain_yaml.load_yaml("a: [1, {b: c}]") == {"a": [1, {"b": "c"}]}


def test_three_hundred_mutations_are_read_or_refused_in_one_line(
    tmp_path: Path, record: Callable[..., Path]
) -> None:
    """Whatever is read of them, by inspect, verify or an evaluation, it ends well or in one line.

    Among them files without checksums, so that damage reaches what lies behind them. In a process of its
    own, which has 6 GB of address space.
    """
    bags = [record(tmp_path / "own", frames=2)]
    for name, compression in (("plain", CompressionType.NONE), ("lz4", CompressionType.LZ4)):
        bags.append(unprotected(bags[0], tmp_path / name, compression))
    script = Path(__file__).parent / "mutations.py"
    command = [sys.executable, str(script), "300", *map(str, bags)]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))

    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        command, capture_output=True, text=True, preexec_fn=limit, env=environment, timeout=900
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    good, refused = map(int, done.stdout.split())
    assert good + refused == 900
    assert refused > 300  # most mutations are seen


def unprotected(bag: Path, out: Path, compression: CompressionType) -> Path:
    """The same messages, by the library's writer without a checksum."""
    out.mkdir()
    (out / "metadata.yaml").write_text((bag / "metadata.yaml").read_text().replace("own_0", "a"))
    with (out / "a.mcap").open("wb") as stream:
        writer = Writer(
            stream, compression=compression, enable_crcs=False, enable_data_crcs=False, chunk_size=4000
        )
        writer.start("ros2", "other")
        channels: dict[str, int] = {}
        for raw in BagReader(bag).raw_messages():
            if raw.topic.name not in channels:
                schema = writer.register_schema(
                    raw.topic.type, "ros2msg", schema_text(raw.topic.type).encode()
                )
                channels[raw.topic.name] = writer.register_channel(raw.topic.name, "cdr", schema)
            writer.add_message(channels[raw.topic.name], raw.log_time_ns, raw.cdr, raw.publish_time_ns)
        writer.finish()
    return out
