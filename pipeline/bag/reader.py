"""Read bags: advpipe's own, and those that ROS 2 or another tool recorded as MCAP."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys.store import Typestore

from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.provenance import RECORD_NAME, checked_provenance
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, one_line
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.remote_path import located
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.mcap.channel import RawMessage, TopicInfo
from advpipe.pipeline.mcap.file_sequence import FileSequence
from advpipe.pipeline.mcap.reader import McapFile
from advpipe.pipeline.messages.cloud import StampedCloud, cloud_from_cdr
from advpipe.pipeline.messages.debug import is_debug
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.pipeline.messages.object_count import has_more_objects
from advpipe.pipeline.messages.types import missing_field, schema_text, types_from, typestore

OBJECTS_LIMIT = 1 << 23
"""The most Python objects that a message may become: some 0.8 GB. A transform is 17, in 80 bytes."""

_SMALL_BYTES = 1 << 16  # of which no type makes too many


class BagReader:
    """A rosbag2 directory or a bare .mcap file.

    Nothing stays open between calls, memory holds one chunk at a time, and every checksum that the bag
    carries is validated. Debug topics (`messages.debug`), which tell what an attack did, are left out unless
    `debug` asks for them, so that no detector, attack or evaluation takes them for input. Damaged or foreign
    input raises AdvpipeError, one line with the file's name.
    """

    def __init__(self, path: Path, *, debug: bool = False) -> None:
        self.path, self._debug = located(path), debug
        self._files = [McapFile(file) for file in mcap_files(self.path)]
        self._sequence = FileSequence(self._files)
        self._stores: dict[tuple[str, str], Typestore | AdvpipeError] = {}
        self._times_ns: dict[str, npt.NDArray[np.int64]] = {}
        detail(f"opened {self.path}: {', '.join(file.path.name for file in self._files)}")

    @cached_property
    def provenance(self) -> Provenance:
        """The `advpipe` record (see `provenance.py`); empty for another tool's bag."""
        for file in self._files:
            if RECORD_NAME in file.metadata:
                return checked_provenance(file.metadata[RECORD_NAME], file.path)
        return Provenance({})

    @cached_property
    def topics(self) -> dict[str, TopicInfo]:
        """Type, offered QoS and number of messages of each topic, by its name."""
        found: dict[str, TopicInfo] = {}
        for file in self._files:
            for topic in {topic.name: topic for topic in file.topics.values()}.values():
                if not self._debug and is_debug(topic.name):
                    continue
                known = found.get(topic.name)
                if known is not None and known.type != topic.type:
                    raise AdvpipeError(f"{self.path}: {topic.name} holds both {known.type} and {topic.type}")
                count = file.counts[topic.name] + (known.count if known else 0)
                found[topic.name] = TopicInfo(topic.type, topic.qos, count)
        return found

    def topics_of_type(self, type_name: str) -> list[str]:
        """Names of the topics of a message type, sorted."""
        return sorted(name for name, info in self.topics.items() if info.type == type_name)

    def raw_messages(
        self,
        topics: Collection[str] | None = None,
        first_ns: int | None = None,
        last_ns: int | None = None,
    ) -> Iterator[RawMessage]:
        """Messages of the named topics (all without names) in log-time order, as they lie in the bag.

        `first_ns` and `last_ns` bound the log time, both included; chunks outside are not unpacked.
        """
        if not self._debug:
            named = [name for file in self._files for name in file.counts] if topics is None else topics
            topics = [name for name in named if not is_debug(name)]
        return self._sequence.raw_messages(topics, first_ns, last_ns)

    def messages(self, topic: str, last_ns: int | None = None) -> Iterator[tuple[int, Any]]:
        """Log time in ns and decoded message of one topic, in log-time order; up to `last_ns`, included."""
        if topic not in self.topics:
            raise UsageError(
                f"{self.path} has no topic {topic}; {known_names(topic, sorted(self.topics), 'it has')}"
            )
        for raw in self.raw_messages([topic], last_ns=last_ns):
            yield raw.log_time_ns, self.decode(raw)

    def log_times_ns(self, topic: str) -> npt.NDArray[np.int64]:
        """Log times (K,) of a topic's messages, ascending; read once from the index, without its messages."""
        if topic not in self._times_ns:
            times_ns = np.concatenate([file.log_times_ns(topic) for file in self._files])
            times_ns.sort(kind="stable")
            times_ns.flags.writeable = False
            self._times_ns[topic] = times_ns
        return self._times_ns[topic]

    def decode(self, raw: RawMessage) -> Any:
        """The message as a dataclass with the fields of its type as the bag defines it.

        Raises AdvpipeError for a damaged one, and for values that nobody can compute with
        (`message_bounds`).
        """
        message = self.decode_as_it_is(raw)
        if problem := implausibility(raw.topic.name, raw.topic.type, message):
            raise AdvpipeError(
                one_line(f"{self.path}: a message of {raw.topic.name} at {raw.log_time_ns} ns {problem}")
            )
        return message

    def decode_as_it_is(self, raw: RawMessage) -> Any:
        """The same, whatever its values are."""
        try:
            store = self._store_for(raw)
            if len(raw.cdr) > _SMALL_BYTES and has_more_objects(
                store, raw.topic.type, raw.cdr, OBJECTS_LIMIT
            ):
                raise AdvpipeError(
                    f"{self.path}: a message of {raw.topic.name} at {raw.log_time_ns} ns has {len(raw.cdr)} "
                    f"bytes and would decode to too many objects as a {raw.topic.type}"
                )
            return store.deserialize_cdr(raw.cdr, raw.topic.type)
        except AdvpipeError:
            raise
        except Exception:  # rosbags makes code of the bag's definitions: they can fail in any way
            raise AdvpipeError(
                f"{self.path}: a message of {raw.topic.name} at {raw.log_time_ns} ns is not a valid "
                f"{raw.topic.type}"
            ) from None

    def type_hash(self, raw: RawMessage) -> str:
        """The RIHS01 hash (REP-2011) of a message's type as the bag defines it."""
        try:
            return self._store_for(raw).hash_rihs01(raw.topic.type)
        except AdvpipeError:
            raise
        except Exception:  # as above
            raise AdvpipeError(f"{self.path}: the definition of {raw.topic.type} is damaged") from None

    def cloud(self, raw: RawMessage) -> StampedCloud:
        """The points of a message of a PointCloud2 topic (see `cloud_from_cdr`)."""
        try:
            return cloud_from_cdr(raw.cdr)
        except AdvpipeError as error:
            where = f"{self.path}: {raw.topic.name} at {raw.log_time_ns} ns"
            raise AdvpipeError(f"{where}: {error}") from None

    def _store_for(self, raw: RawMessage) -> Typestore:
        """Our own types where the bag defines them alike, the bag's elsewhere; a definition is read once."""
        name, key = raw.topic.type, (raw.topic.type, raw.schema)
        if name in typestore().types and raw.schema == schema_text(name):
            return typestore()
        if key not in self._stores:
            try:
                self._stores[key] = self._store_of_bag(raw)
            except AdvpipeError as error:
                self._stores[key] = error
            except Exception:  # as above
                self._stores[key] = AdvpipeError(f"{self.path}: the definition of {name} cannot be read")
        store = self._stores[key]
        if isinstance(store, AdvpipeError):
            raise store
        return store

    def _store_of_bag(self, raw: RawMessage) -> Typestore:
        store, name = Typestore(), raw.topic.type
        store.register(types_from(raw.schema, raw.schema_encoding, name))
        if name in typestore().types and (field := missing_field(store, name)):
            raise AdvpipeError(
                f"{self.path}: {raw.topic.name} has {name} of another release, without the field {field}; "
                "advpipe reads types of Humble and later"
            )
        return store
