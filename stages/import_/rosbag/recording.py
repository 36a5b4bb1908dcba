"""Recordings of ROS 1 (.bag) and ROS 2 (MCAP, SQLite), read alike."""

from __future__ import annotations

import bz2
import heapq
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

import lz4.frame  # type: ignore[import-untyped]
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Rosbag1Reader
from rosbags.rosbag1.reader import Chunk
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from advpipe.pipeline.bag.files import METADATA_NAME, read_information
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, one_line
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.pipeline.messages.types import types_from
from advpipe.stages.import_.rosbag.definitions import known_types

_MOST_CHUNK_BYTES = 1 << 28
"""Of an unpacked chunk of ROS 1, which holds a few messages."""

_MOST_MESSAGE_BYTES = 1 << 28
_MOST_CONNECTIONS = 10_000
_CHECKED = ("tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry")
TF_OF_ROS1 = "tf/msg/tfMessage"


class TopicContent(NamedTuple):
    """Type and number of messages of a topic."""

    type: str
    messages: int


class Recorded(NamedTuple):
    """A message as it was recorded; `raw` is for `Recording.decode`."""

    topic: str
    type: str
    log_time_ns: int
    raw: Any


class Recording(Protocol):
    """A recording whose files are open only while messages are read."""

    path: Path
    provenance: Mapping[str, str]
    """Of a bag of advpipe; empty elsewhere."""

    @property
    def topics(self) -> Mapping[str, TopicContent]:
        """The topics by name."""

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        """The messages of these topics in log-time order."""

    def decode(self, recorded: Recorded) -> Any:
        """The message as an object with the fields of its type. Raises AdvpipeError for a damaged one."""


def open_recording(source: Path) -> Recording:
    """The recording that a file or folder is. Raises UsageError for anything else."""
    if not source.exists():
        raise UsageError(f"{source} does not exist; give a .bag, .mcap or .db3 file, or a rosbag2 directory")
    if source.is_dir() and not (source / METADATA_NAME).is_file() and not _is_data_set(source):
        source_files = _files_in(source)
    else:
        source_files = [source]
    if all(file.is_file() and _begins_with(file, b"#ROSBAG V") for file in source_files):
        return RosbagsRecording(source, [_BoundedRosbag1Reader(file) for file in source_files], is_ros1=True)
    (one,) = source_files
    is_sqlite = one.is_file() and _begins_with(one, b"SQLite format 3\0")
    if is_sqlite or (one.is_dir() and not _is_data_set(one) and not _is_plain_mcap(one)):
        with _one_line_errors(one):
            return RosbagsRecording(one, [Rosbag2Reader(one)], is_ros1=False)
    return McapRecording(resolve_bag(one))


def _is_data_set(folder: Path) -> bool:
    return (folder / "clean" / METADATA_NAME).is_file()


def _is_plain_mcap(folder: Path) -> bool:
    information = read_information(folder / METADATA_NAME)
    compressed = str(information.get("compression_mode") or "none").lower() != "none"
    return information.get("storage_identifier") == "mcap" and not compressed


def _files_in(folder: Path) -> list[Path]:
    """The parts of a ROS 1 recording in a folder, or the only file of ROS 2."""
    bags = sorted(folder.glob("*.bag"))
    others = sorted(file for suffix in ("*.mcap", "*.db3") for file in folder.glob(suffix))
    if bags and not others:
        return bags
    if len(others) == 1 and not bags:
        return others
    found = ", ".join(file.name for file in (bags + others)[:5]) or "no .bag, .mcap or .db3"
    raise UsageError(
        f"{folder} is not one recording, it holds {found}; give one file, or a rosbag2 directory"
    )


def _begins_with(file: Path, magic: bytes) -> bool:
    try:
        with file.open("rb") as stream:
            return stream.read(len(magic)) == magic
    except OSError as error:
        raise UsageError(f"{file}: cannot be read: {error.strerror or error}") from None


class McapRecording:
    """A recording in MCAP, read by advpipe's own reader."""

    def __init__(self, path: Path) -> None:
        self.path, self._reader = path, BagReader(path)
        self.provenance: Mapping[str, str] = self._reader.provenance

    @property
    def topics(self) -> Mapping[str, TopicContent]:
        return {name: TopicContent(info.type, info.count) for name, info in self._reader.topics.items()}

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        for raw in self._reader.raw_messages(topics):
            yield Recorded(raw.topic.name, raw.topic.type, raw.log_time_ns, raw)

    def decode(self, recorded: Recorded) -> Any:
        return self._reader.decode(cast(RawMessage, recorded.raw))


class _BoundedRosbag1Reader(Rosbag1Reader):
    """A reader of ROS 1 that unpacks no chunk beyond a bound, whatever its header says."""

    def read_chunk(self) -> Chunk:
        chunk = super().read_chunk()
        name = getattr(chunk.decompressor, "__name__", "")
        module = getattr(chunk.decompressor, "__module__", "")
        if name == "decompress":
            unpack = _unpack_bz2 if "bz2" in module else _unpack_lz4
            return chunk._replace(decompressor=unpack)
        return chunk


def _unpack_bz2(packed: bytes) -> bytes:
    return _bounded(partial(bz2.BZ2Decompressor().decompress, packed))


def _unpack_lz4(packed: bytes) -> bytes:
    return _bounded(partial(lz4.frame.LZ4FrameDecompressor().decompress, packed))


def _bounded(unpack: Callable[..., bytes]) -> bytes:
    data = unpack(max_length=_MOST_CHUNK_BYTES + 1)
    if len(data) > _MOST_CHUNK_BYTES:
        raise AdvpipeError(f"a chunk unpacks to more than {_MOST_CHUNK_BYTES >> 20} MiB")
    return data


class RosbagsRecording:
    """A recording in ROS 1's format or in SQLite, read by rosbags."""

    def __init__(
        self, path: Path, readers: Sequence[Rosbag1Reader] | Sequence[Rosbag2Reader], *, is_ros1: bool
    ) -> None:
        self.path, self._readers, self._is_ros1 = path, readers, is_ros1
        self.provenance: Mapping[str, str] = {}
        self._stores: dict[tuple[str, str], Typestore] = {}
        with self._opened() as connections:
            if len(connections) > _MOST_CONNECTIONS:
                raise AdvpipeError(f"{path}: has {len(connections):,} connections")
            counted: dict[str, int] = {}
            types: dict[str, str] = {}
            for each in connections:
                counted[each.topic] = counted.get(each.topic, 0) + each.msgcount
                if types.setdefault(each.topic, each.msgtype) != each.msgtype:
                    raise AdvpipeError(
                        f"{path}: {each.topic} holds both {types[each.topic]} and {each.msgtype}"
                    )
        self._topics = {name: TopicContent(types[name], count) for name, count in counted.items()}

    @property
    def topics(self) -> Mapping[str, TopicContent]:
        return self._topics

    @contextmanager
    def _opened(self) -> Iterator[list[Connection]]:
        with _one_line_errors(self.path), ExitStack() as stack:
            for reader in self._readers:
                stack.enter_context(reader)
            yield [connection for reader in self._readers for connection in reader.connections]

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        with self._opened():
            parts = [
                reader.messages(wanted)
                for reader in self._readers
                if (wanted := [each for each in reader.connections if each.topic in topics])
            ]
            for connection, log_time_ns, data in heapq.merge(*parts, key=lambda part: part[1]):
                if not isinstance(log_time_ns, int) or not isinstance(data, bytes | memoryview):
                    raise AdvpipeError(  # SQLite holds anything in any column
                        f"{self.path}: a message of {connection.topic} has no time or no bytes"
                    )
                yield Recorded(connection.topic, connection.msgtype, log_time_ns, (connection, data))

    def decode(self, recorded: Recorded) -> Any:
        connection, data = recorded.raw
        where = f"{self.path}: a message of {recorded.topic} at {recorded.log_time_ns} ns"
        if len(data) > _MOST_MESSAGE_BYTES:
            raise AdvpipeError(f"{where} has {len(data):,} bytes")
        store = self._store_of(connection)
        try:
            read = store.deserialize_ros1 if self._is_ros1 else store.deserialize_cdr
            message = read(data, connection.msgtype)
        except Exception:  # rosbags makes code of the definitions: they can fail in any way
            raise AdvpipeError(f"{where} is not a valid {recorded.type}") from None
        type_name = "tf2_msgs/msg/TFMessage" if recorded.type == TF_OF_ROS1 else recorded.type
        if type_name in _CHECKED and (problem := implausibility("", type_name, message)):
            raise AdvpipeError(one_line(f"{where} {problem}"))
        return message

    def _store_of(self, connection: Connection) -> Typestore:
        """The types as the recording defines them; SQLite without definitions has those of `known_types`."""
        name, definition = connection.msgtype, connection.msgdef
        if definition.format == MessageDefinitionFormat.NONE or not definition.data:
            if name not in known_types().fielddefs:
                raise AdvpipeError(
                    f"{self.path}: {connection.topic} has {name}, which the recording does not define and "
                    "advpipe does not know; record it as MCAP, which holds definitions"
                )
            return known_types()
        if (name, definition.data) not in self._stores:
            is_idl = definition.format == MessageDefinitionFormat.IDL
            store = get_typestore(Stores.EMPTY)
            try:
                store.register(types_from(definition.data, "ros2idl" if is_idl else "ros2msg", name))
            except Exception:  # as above
                raise AdvpipeError(f"{self.path}: the definition of {name} cannot be read") from None
            self._stores[name, definition.data] = store
        return self._stores[name, definition.data]


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    """Failures of rosbags in reading a file as AdvpipeError."""
    try:
        yield
    except AdvpipeError:
        raise
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or shorten(one_line(error))}") from None
    except Exception as error:  # assertions, struct, SQLite: a damaged file can fail in any way
        text = shorten(one_line(error), 300) or type(error).__name__
        raise AdvpipeError(f"{path}: is damaged or no recording: {text}") from None
