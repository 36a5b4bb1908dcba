"""Write a rosbag2 directory that ROS 2, Foxglove and every MCAP tool opens.

MCAP with the `ros2` profile: chunks with message indexes and checksums, CDR on every channel, QoS and
type hash in the channel metadata, and a version 8 metadata.yaml, which Humble and later read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import indent
from types import TracebackType
from typing import IO

import yaml

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.provenance import RECORD_NAME, with_checksum
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError, os_error_line
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.partial import PartialFolder, final_path
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.mcap.qos import qos_to_yaml
from advpipe.pipeline.mcap.writer import COMPRESSIONS, McapWriter
from advpipe.pipeline.messages.types import schema_text, serialise, type_hash

FILES_RECORD = "advpipe_files"
"""The metadata record with the SHA-256 of each file beside the bag, by its name; none without such files."""

_qos_text = cache(qos_to_yaml)


@dataclass
class _Channel:
    id: int
    topic: Topic
    type_hash: str
    count: int = 0


class BagWriter:
    """A bag in the making; it takes its name when the `with` block ends without an error.

    >>> with BagWriter(Path("clean"), provenance={"kind": "clean"}) as bag:
    ...     bag.write(CLOCK, messages.clock(stamp_ns), stamp_ns)

    path: the rosbag2 directory to make. provenance: see `provenance.py`; it leads the file, so that a
    truncated recording still has it. compression: of the chunks, a key of `COMPRESSIONS`. finish: called with
    the folder when the bag in it is whole, before it takes its name; for files that no checksum covers.
    The bytes written depend on the arguments alone: no clock, no host. They are compressed and written while
    the caller goes on, so the error of a full disk may come some messages late, or at the end of the block.
    """

    def __init__(
        self,
        path: Path,
        *,
        provenance: Mapping[str, str],
        overwrite: bool = False,
        compression: str = "zstd",
        finish: Callable[[Path], None] | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise UsageError(f"compression {compression!r} is unknown; use one of {', '.join(COMPRESSIONS)}")
        self.path = Path(path)
        self._provenance = Provenance(provenance, f"{path}: the provenance record")
        self._overwrite = overwrite
        self._compression, self._finish_folder = compression, finish
        self._channels: dict[str, _Channel] = {}
        self._schema_ids: dict[tuple[str, str], int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._refuse_existing()

    def __enter__(self) -> BagWriter:
        self._refuse_existing()
        with self._disk_errors():
            self._folder = PartialFolder(self.path)
            try:
                self._file: IO[bytes] = (self._folder.path / self._file_name).open("wb")
                self._mcap = McapWriter(self._file, self._compression)
                self._mcap.add_metadata(RECORD_NAME, with_checksum(self._provenance))
            except BaseException:
                self._folder.discard()
                raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                with self._disk_errors():
                    self._finish()
                    if self._finish_folder is not None:
                        self._finish_folder(self.folder)
                    self._folder.commit(may_replace=lambda old: self._overwrite and _is_bag(old))
        except BaseException:
            self._discard()
            raise
        if kind is not None:
            self._discard()

    @property
    def folder(self) -> Path:
        """Where the bag is made: files put here, such as labels, appear with the bag under its name."""
        return self._folder.path

    def write(self, topic: Topic, message: object, stamp_ns: int) -> None:
        """Serialise and append a message of one of `types.py`'s types."""
        self.write_cdr(topic, serialise(message, topic.type), stamp_ns)

    def write_cdr(self, topic: Topic, cdr: bytes, stamp_ns: int) -> None:
        """Append a message that is serialised already."""
        channel = self._channel(topic, schema_text(topic.type), "ros2msg", type_hash(topic.type))
        self._append(channel, cdr, stamp_ns, stamp_ns, channel.count)

    def copy(self, raw: RawMessage) -> None:
        """Append a message of another bag as it is: same bytes, times and sequence number."""
        channel = self._channel(raw.topic, raw.schema, raw.schema_encoding, raw.topic.type_hash)
        self._append(channel, raw.cdr, raw.log_time_ns, raw.publish_time_ns, raw.sequence)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Keep a metadata record, such as one of another tool's, beside those that every bag has."""
        with self._disk_errors():
            self._mcap.add_metadata(name, record)

    def _append(self, channel: _Channel, cdr: bytes, log_ns: int, publish_ns: int, sequence: int) -> None:
        if not 0 <= log_ns < 2**63:
            raise AdvpipeError(
                f"{channel.topic.name}: the time stamp {log_ns} ns is outside the range that a bag can hold"
            )
        with self._disk_errors():
            self._mcap.add_message(channel.id, log_ns, cdr, publish_ns, sequence)
        channel.count += 1
        self._first_ns = log_ns if self._first_ns is None else min(self._first_ns, log_ns)
        self._last_ns = max(self._last_ns, log_ns)

    def _channel(self, topic: Topic, schema: str, encoding: str, type_hash: str) -> _Channel:
        channel = self._channels.get(topic.name)
        if channel is None:
            if (schema_id := self._schema_ids.get((topic.type, schema))) is None:
                schema_id = self._mcap.add_schema(topic.type, encoding, schema.encode())
                self._schema_ids[topic.type, schema] = schema_id
            metadata = {"offered_qos_profiles": _qos_text(topic.qos), "topic_type_hash": type_hash}
            channel_id = self._mcap.add_channel(topic.name, schema_id, metadata)
            channel = self._channels[topic.name] = _Channel(channel_id, topic, type_hash)
        elif channel.topic.type != topic.type:
            raise AdvpipeError(
                f"{topic.name} already holds {channel.topic.type}; {topic.type} needs another topic"
            )
        return channel

    def _finish(self) -> None:
        if beside := self._files_beside():
            self._mcap.add_metadata(FILES_RECORD, beside)
        information = _single_lines(self._information())
        self._mcap.add_metadata("rosbag2", {"serialized_metadata": information})
        self._mcap.finish()
        self._file.close()
        metadata = f"rosbag2_bagfile_information:\n{indent(information, '  ')}"
        (self._folder.path / METADATA_NAME).write_text(metadata, encoding="utf-8")

    def _files_beside(self) -> dict[str, str]:
        """The checksums of the files that were put into `folder`: labels, the attack's request."""
        return {
            path.name: sha256_of(path)
            for path in sorted(self.folder.iterdir())
            if path.is_file() and not path.name.startswith(".") and path.name != self._file_name
        }

    def _discard(self) -> None:
        try:
            self._mcap.abort()
        finally:
            self._remove()

    def _remove(self) -> None:
        with suppress(OSError):  # a full disk: what the buffer still holds is lost with the folder
            self._file.close()
        self._folder.discard()

    def _refuse_existing(self) -> None:
        if not self.path.exists():
            return
        if not self._overwrite:
            raise OutputExistsError(self.path)
        if not _is_bag(self.path):
            raise UsageError(
                f"{self.path} is not a rosbag2 directory and is not replaced; choose another name"
            )

    @property
    def _file_name(self) -> str:
        return f"{self.path.name}_0.mcap"

    @contextmanager
    def _disk_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            error.filename = None  # the hidden folder's name would not help the user
            raise AdvpipeError(
                f"{final_path(self.path)}: cannot be written: {os_error_line(error)}"
            ) from None

    def _information(self) -> dict[str, object]:
        """The content of metadata.yaml (rosbag2_storage's BagMetadata, version 8)."""
        return {
            "version": 8,
            "storage_identifier": "mcap",
            **self._span(),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": channel.topic.name,
                        "type": channel.topic.type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": _qos_text(channel.topic.qos),
                        "type_description_hash": channel.type_hash,
                    },
                    "message_count": channel.count,
                }
                for channel in self._channels.values()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._file_name],
            "files": [{"path": self._file_name, **self._span()}],
            "custom_data": {},
            "ros_distro": "advpipe",
        }

    def _span(self) -> dict[str, object]:
        start_ns = self._first_ns or 0
        return {
            "duration": {"nanoseconds": self._last_ns - start_ns},
            "starting_time": {"nanoseconds_since_epoch": start_ns},
            "message_count": sum(channel.count for channel in self._channels.values()),
        }


def _is_bag(path: Path) -> bool:
    return (path / METADATA_NAME).is_file()


def _single_lines(document: object) -> str:
    """YAML with each string on one line, which simple readers of metadata.yaml need."""
    return yaml.safe_dump(document, sort_keys=False, width=10**9)
