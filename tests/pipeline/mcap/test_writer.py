"""The oracle is the MCAP library's own writer: the same calls have to give the same bytes."""

import io
from functools import partial
from types import SimpleNamespace

import mcap.writer
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

from advpipe.pipeline.mcap.writer import CHUNK_BYTES, CHUNKS_IN_WAIT, ZSTD_LEVEL, McapWriter

TYPES = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
Calls = list[tuple[str, tuple[object, ...]]]


def calls(messages: int) -> Calls:
    """A recording of two schemas and three channels; big messages end chunks, times do not ascend."""
    rng = np.random.default_rng(messages)
    found: Calls = [
        ("metadata", ("first", {"kind": "clean", "ü": "ö"})),
        ("schema", ("a/msg/A", "ros2msg", b"float64 a")),
        ("channel", ("/a", 1, {"qos": "x"})),
        ("channel", ("/b", 1, {})),
    ]
    for number in range(messages):
        if number == messages // 2:
            found += [("schema", ("b/msg/B", "ros2msg", b"")), ("channel", ("/c", 2, {}))]
        channel = int(rng.integers(1, 3 if number < messages // 2 else 4))
        size = 700_000 if number % 5 == 0 else int(rng.integers(0, 300))
        body = rng.integers(0, 4, size, dtype=np.uint8).tobytes()
        time_ns = 1000 + number + int(rng.integers(0, 5))
        found.append(("message", (channel, time_ns, body, time_ns + 7, number)))
    return [*found, ("metadata", ("last", {}))]


def ours(recording: Calls, compression: str) -> bytes:
    stream = io.BytesIO()
    writer = McapWriter(stream, compression)
    for name, arguments in recording:
        getattr(writer, f"add_{name}")(*arguments)
    writer.finish()
    return stream.getvalue()


def theirs(recording: Calls, compression: str) -> bytes:
    stream = io.BytesIO()
    writer = mcap.writer.Writer(stream, compression=TYPES[compression], enable_data_crcs=True)
    writer.start("ros2", "advpipe")
    for name, arguments in recording:
        match name:
            case "channel":
                topic, schema, metadata = arguments
                writer.register_channel(topic, "cdr", schema, metadata)
            case "schema":
                writer.register_schema(*arguments)
            case "message":
                writer.add_message(*arguments)
            case "metadata":
                writer.add_metadata(*arguments)
    writer.finish()
    return stream.getvalue()


@pytest.mark.oracle
@pytest.mark.parametrize("compression", TYPES)
@pytest.mark.parametrize("messages", [0, 1, 60])
def test_the_bytes_equal_those_of_the_mcap_library(
    monkeypatch: pytest.MonkeyPatch, compression: str, messages: int
) -> None:
    level = SimpleNamespace(compress=partial(zstandard.compress, level=ZSTD_LEVEL))
    monkeypatch.setattr(mcap.writer, "zstandard", level)  # which knows the usual level only
    recording = calls(messages)
    assert ours(recording, compression) == theirs(recording, compression)


class Disk(io.RawIOBase):
    """Refuses to hold more than `room` bytes, like a full disk."""

    def __init__(self, room: int) -> None:
        self.room = room

    def write(self, block: bytes | memoryview) -> int:
        if len(block) > self.room:
            raise OSError(28, "No space left on device")
        self.room -= len(block)
        return len(block)


@pytest.mark.parametrize("room", [0, 100, 5_000_000])
def test_a_write_error_reaches_a_later_call(room: int) -> None:
    writer = McapWriter(Disk(room), "none")
    schema = writer.add_schema("a/msg/A", "ros2msg", b"")
    channel = writer.add_channel("/a", schema, {})
    numbers = iter(range(100))

    def write_on() -> None:
        for number in numbers:
            writer.add_message(channel, number, bytes(CHUNK_BYTES), number, number)

    with pytest.raises(OSError, match="No space left"):
        write_on()
    writer.abort()
    assert next(numbers) * CHUNK_BYTES <= room + (CHUNKS_IN_WAIT + 4) * CHUNK_BYTES


def test_finish_raises_a_write_error() -> None:
    writer = McapWriter(Disk(200), "none")
    channel = writer.add_channel("/a", writer.add_schema("a/msg/A", "ros2msg", b""), {})
    writer.add_message(channel, 1, bytes(1000), 1, 1)
    with pytest.raises(OSError, match="No space left"):
        writer.finish()
    writer.abort()
