"""Write a rosbag2 directory that ROS 2, Foxglove and every MCAP tool opens.

MCAP with the `ros2` profile: chunks with message indexes and checksums, CDR on every channel, QoS and
type hash in the channel metadata, and a version 8 metadata.yaml, which Humble and later read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent
from types import TracebackType

import yaml

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.part import BagPart, BagSplit
from advpipe.pipeline.bag.provenance import with_checksum
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError, os_error_line
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.partial import PartialFolder, final_path
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.mcap.qos import qos_to_yaml
from advpipe.pipeline.mcap.writer import COMPRESSIONS
from advpipe.pipeline.messages.types import schema_text, serialise, type_hash

FILES_RECORD = "advpipe_files"
"""The metadata record with the SHA-256 of each file beside the bag, by its name; none without such files."""


@dataclass
class _WrittenTopic:
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
    split: where the bag goes on in another file, NAME_1.mcap, NAME_2.mcap, ...; by default it is one file.
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
        split: BagSplit | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise UsageError(f"compression {compression!r} is unknown; use one of {', '.join(COMPRESSIONS)}")
        self.path = Path(path)
        self._provenance = Provenance(provenance, f"{path}: the provenance record")
        self._overwrite = overwrite
        self._compression, self._finish_folder = compression, finish
        self._split = split or BagSplit()
        self._topics: dict[str, _WrittenTopic] = {}
        self._parts: list[BagPart] = []
        self._refuse_existing()

    def __enter__(self) -> BagWriter:
        self._refuse_existing()
        with self._disk_errors():
            self._folder = PartialFolder(self.path)
            try:
                self._begin_part()
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
        written = self._written(topic, type_hash(topic.type))
        raw = RawMessage(topic, schema_text(topic.type), cdr, stamp_ns, stamp_ns, written.count)
        self._append(written, raw)

    def copy(self, raw: RawMessage) -> None:
        """Append a message of another bag as it is: same bytes, times and sequence number."""
        self._append(self._written(raw.topic, raw.topic.type_hash), raw)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Keep a metadata record, such as one of another tool's, beside those that every bag has."""
        with self._disk_errors():
            self._parts[-1].mcap.add_metadata(name, record)

    def _append(self, written: _WrittenTopic, raw: RawMessage) -> None:
        if not 0 <= raw.log_time_ns < 2**63:
            raise AdvpipeError(
                f"{written.topic.name}: the time stamp {raw.log_time_ns} ns is outside the range that a bag "
                "can hold"
            )
        try:
            if self._parts[-1].is_full(self._split, raw.log_time_ns, len(raw.cdr)):
                self._parts[-1].finish(_single_lines(self._information()))
                self._begin_part()
            self._parts[-1].add(raw, written.type_hash)
        except OSError as error:  # `_disk_errors` would take as long as the rest: messages are many
            raise self._disk_error(error) from None
        written.count += 1

    def _begin_part(self) -> None:
        path = self._folder.path / f"{self.path.name}_{len(self._parts)}.mcap"
        self._parts.append(BagPart(path, self._compression, with_checksum(self._provenance)))

    def _written(self, topic: Topic, type_hash: str) -> _WrittenTopic:
        written = self._topics.get(topic.name)
        if written is None:
            written = self._topics[topic.name] = _WrittenTopic(topic, type_hash)
        elif written.topic.type != topic.type:
            raise AdvpipeError(
                f"{topic.name} already holds {written.topic.type}; {topic.type} needs another topic"
            )
        return written

    def _finish(self) -> None:
        if beside := self._files_beside():
            self._parts[-1].mcap.add_metadata(FILES_RECORD, beside)
        information = _single_lines(self._information())
        self._parts[-1].finish(information)
        metadata = f"rosbag2_bagfile_information:\n{indent(information, '  ')}"
        (self._folder.path / METADATA_NAME).write_text(metadata, encoding="utf-8")

    def _files_beside(self) -> dict[str, str]:
        """The checksums of the files that were put into `folder`: labels, the attack's request."""
        own = [part.path for part in self._parts]
        return {
            path.name: sha256_of(path)
            for path in sorted(self.folder.iterdir())
            if path.is_file() and not path.name.startswith(".") and path not in own
        }

    def _discard(self) -> None:
        try:
            self._parts[-1].abort()
        finally:
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

    @contextmanager
    def _disk_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._disk_error(error) from None

    def _disk_error(self, error: OSError) -> AdvpipeError:
        error.filename = None  # the hidden folder's name would not help the user
        return AdvpipeError(f"{final_path(self.path)}: cannot be written: {os_error_line(error)}")

    def _information(self) -> dict[str, object]:
        """The content of metadata.yaml (rosbag2_storage's BagMetadata, version 8)."""
        return {
            "version": 8,
            "storage_identifier": "mcap",
            **_span(self._parts),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": written.topic.name,
                        "type": written.topic.type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": qos_to_yaml(written.topic.qos),
                        "type_description_hash": written.type_hash,
                    },
                    "message_count": written.count,
                }
                for written in self._topics.values()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [part.path.name for part in self._parts],
            "files": [{"path": part.path.name, **_span([part])} for part in self._parts],
            "custom_data": {},
            "ros_distro": "advpipe",
        }


def _span(parts: Sequence[BagPart]) -> dict[str, object]:
    """Start, duration and number of messages of some files together."""
    starts = [part.first_ns for part in parts if part.first_ns is not None]
    start_ns, end_ns = min(starts, default=0), max((part.last_ns for part in parts), default=0)
    return {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": sum(part.count for part in parts),
    }


def _is_bag(path: Path) -> bool:
    return (path / METADATA_NAME).is_file()


def _single_lines(document: object) -> str:
    """YAML with each string on one line, which simple readers of metadata.yaml need."""
    return yaml.safe_dump(document, sort_keys=False, width=10**9)
