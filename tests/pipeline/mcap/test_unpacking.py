"""Small files that would take hours or all memory: each is refused or reported at a bounded cost."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Message, Schema
from mcap.writer import MCAP0_MAGIC, Writer
from rosbags.typesys.store import Typestore

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.salvage import Salvage
from advpipe.pipeline.mcap.unpacking import FREE_BYTES, MESSAGE_BYTES, RATIO, UnpackBudget
from advpipe.pipeline.messages.object_count import has_more_objects
from advpipe.pipeline.messages.types import schema_text, types_from
from advpipe.stages.verify.mcap_scanner import McapScanner

LINE = "\n" + "=" * 80 + "\n"
HEAD = b"\0\1\0\0"


def write(path: Path, type_name: str, definition: str, messages: Iterable[bytes]) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 28)
        writer.start("ros2", "other")
        schema = writer.register_schema(type_name, "ros2msg", definition.encode())
        channel = writer.register_channel("/a", "cdr", schema)
        for number, data in enumerate(messages):
            writer.add_message(channel, number, data, number)
        writer.finish()
    return path


def transforms(count: int) -> bytes:
    """CDR of a TFMessage: a stamp, two empty names, padding up to eight, seven numbers, and so on."""
    first = struct.pack("<iiIB3xIB", 0, 0, 1, 0, 1, 0)
    first += bytes(-(4 + len(first)) % 8) + struct.pack("<7d", *range(7))
    more = struct.pack("<iiIB3xIB", 0, 0, 1, 0, 1, 0)
    more += bytes(-len(more) % 8) + struct.pack("<7d", *range(7))
    return HEAD + struct.pack("<I", count) + first + more * (count - 1)


def test_a_message_of_millions_of_objects_is_refused(tmp_path: Path) -> None:
    """A million transforms in 88 MB, which pack to 8 kB, would be 20 million objects."""
    name = "tf2_msgs/msg/TFMessage"
    path = write(tmp_path / "a.mcap", name, schema_text(name), [transforms(3000), transforms(1_000_000)])
    assert path.stat().st_size < 100_000
    reader = BagReader(path)
    few, many = reader.raw_messages()
    decoded = reader.decode(few).transforms
    assert len(decoded) == 3000
    assert {one.transform.rotation.w for one in decoded} == {6.0}
    with pytest.raises(AdvpipeError, match="would decode to too many objects as a tf2_msgs/msg/TFMessage"):
        reader.decode(many)


def objects_in(store: Typestore, message: Any) -> int:
    """Of what rosbags made of a message: the dataclasses, texts, numbers and arrays in it."""
    if isinstance(message, list):
        return 1 + sum(objects_in(store, item) for item in message)
    if not is_dataclass(message):
        return 1
    names = [name for name, _ in store.fielddefs[message.__msgtype__][1]]  # type: ignore[attr-defined]
    return 1 + sum(objects_in(store, getattr(message, name)) for name in names)


def test_the_count_equals_the_objects_that_are_made(tmp_path: Path, record: Callable[..., Path]) -> None:
    """By what rosbags made of messages of nine types, to the last object."""
    reader = BagReader(record(tmp_path / "a"))
    seen = set()
    for raw in reader.raw_messages():
        if raw.topic.name in seen:
            continue
        seen.add(raw.topic.name)
        store = reader._store_for(raw)
        count = objects_in(store, reader.decode(raw))
        assert not has_more_objects(store, raw.topic.type, raw.cdr, count), raw.topic.name
        assert has_more_objects(store, raw.topic.type, raw.cdr, count - 1), raw.topic.name
        assert not has_more_objects(store, raw.topic.type, raw.cdr[:-1], count), raw.topic.name
    assert len(seen) > 8


@pytest.mark.parametrize(
    ("encoding", "text"),
    [
        ("ros2msg", f"D[] d{LINE}MSG: a/D\nE[] e{LINE}MSG: a/E\nuint8[0] x"),
        ("ros2idl", "module a { const int32 X = ((1)); };"),
        ("ros2idl", f"module a {{ const int32 X = {'+'.join(['(1)'] * 50)}; }};"),
        ("ros2idl", 'module a { const string X = "a"; /* ( */ @a(x=(1)) struct B { int8 x; }; };'),
    ],
)
def test_definitions_that_take_too_long_are_refused(encoding: str, text: str) -> None:
    """The first, with 7 kB of message, would be five million objects; of the others, rosbags reads the first
    for a second, and one more pair of parentheses for minutes."""
    with pytest.raises(ValueError, match=r"array of no items|sums in parentheses"):
        types_from(text, encoding, "a/msg/B")


def test_idl_with_valid_parentheses_is_read() -> None:
    note = '@verbatim(language="comment", text="(a (b))") // (('
    text = f"module a {{ module msg {{ {note}\n struct B {{ int8 x; }}; }}; }};"
    assert set(types_from(text, "ros2idl", "a/msg/B")) == {"a/msg/B"}


def test_a_definition_is_parsed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long one takes seconds, and no longer for each message."""
    calls = []

    def count(*arguments: str) -> None:
        calls.append(arguments)
        raise ValueError

    monkeypatch.setattr("advpipe.pipeline.bag.reader.types_from", count)
    reader = BagReader(write(tmp_path / "a.mcap", "a/msg/B", "???", [HEAD + b"\0"] * 5))
    for raw in reader.raw_messages():
        with pytest.raises(AdvpipeError):
            reader.decode(raw)
    assert len(calls) == 1


def test_the_budget_equals_values_computed_by_hand() -> None:
    budget = UnpackBudget(10)
    most = FREE_BYTES + RATIO * 10
    chunk = Chunk("", bytes(most // 2**20), 0, 0, 0, most // 2**20)
    for _ in range(2**20 - 1):
        budget._take(chunk.uncompressed_size)
    assert budget.unpack(chunk) == chunk.data
    while budget._taken_bytes + MESSAGE_BYTES <= most:
        budget.count_messages(1)
    with pytest.raises(ValueError, match="too many for its size"):
        budget.count_messages(1)


def file_of(*records: object) -> bytes:
    builder = RecordBuilder()
    for record in (Header("ros2", "x"), *records, DataEnd(0), Footer(0, 0, 0)):
        record.write(builder)  # type: ignore[attr-defined]
    return MCAP0_MAGIC + bytes(builder.end()) + MCAP0_MAGIC  # type: ignore[no-untyped-call]


def packed(*records: object, times: int = 1) -> Chunk:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)  # type: ignore[attr-defined]
    data = bytes(builder.end()) * times  # type: ignore[no-untyped-call]
    return Chunk("zstd", zstandard.compress(data), 0, 0, 0, len(data))


def test_definitions_in_compressed_chunks_are_bounded(tmp_path: Path) -> None:
    schema = Schema(id=1, name="a/msg/B", encoding="ros2msg", data=b"uint8 a")
    chunks = [
        packed(
            schema,
            Channel(
                id=number,
                topic=f"/{number}",
                message_encoding="cdr",
                metadata={"x": "y" * (6 << 20)},
                schema_id=1,
            ),
        )
        for number in range(1, 5)
    ]
    (tmp_path / "a.mcap").write_bytes(file_of(*chunks))
    scanner = McapScanner(tmp_path / "a.mcap")
    assert list(scanner.messages()) == []
    assert scanner.faults == ["damaged or truncated: type and channel definitions exceed 16777216 bytes"]
    assert len(scanner.channels) == 2


def test_messages_without_a_channel_are_reported_once(tmp_path: Path) -> None:
    message = Message(channel_id=9, sequence=0, log_time=0, publish_time=0, data=b"")
    (tmp_path / "a.mcap").write_bytes(file_of(packed(message, times=1000)))
    scanner = McapScanner(tmp_path / "a.mcap")
    assert list(scanner.messages()) == []
    assert sum("which is not defined" in fault for fault in scanner.faults) == 1


def test_recovery_of_a_decompression_bomb_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks are saved up to the limit; the others are reported as lost."""
    monkeypatch.setattr("advpipe.pipeline.mcap.unpacking.FREE_BYTES", 0)
    schema = Schema(id=1, name="std_msgs/msg/String", encoding="ros2msg", data=b"string data")
    channel = Channel(id=1, topic="/text", message_encoding="cdr", metadata={}, schema_id=1)
    text = HEAD + bytes(100_000)
    bomb = packed(Message(channel_id=1, sequence=0, log_time=0, publish_time=0, data=text))
    path = tmp_path / "a.mcap"
    path.write_bytes(file_of(schema, channel, *[bomb] * 40))
    salvage = Salvage(path)
    saved = sum(1 for _ in salvage.messages())
    assert (saved, salvage.lost_chunks) == (RATIO * path.stat().st_size // bomb.uncompressed_size, 40 - saved)
    assert 0 < saved < 40


def test_messages_that_are_held_back_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a message costs beside its bytes counts."""
    monkeypatch.setattr("advpipe.pipeline.mcap.reader.WAITING_LIMIT_BYTES", 1000 * (MESSAGE_BYTES + 5))
    path = write(tmp_path / "a.mcap", "std_msgs/msg/Empty", "", [HEAD + b"\0"] * 1001)
    with pytest.raises(AdvpipeError, match="are out of order"):
        list(BagReader(path).raw_messages())
    assert sum(1 for _ in McapScanner(path).messages()) == 1001
