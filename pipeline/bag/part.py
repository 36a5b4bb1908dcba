"""One .mcap file of a bag that is being written, and where it ends: a bag is split as rosbag2 splits it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO

from advpipe.pipeline.bag.provenance import RECORD_NAME
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.core.document import read_yaml
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.qos import qos_to_yaml
from advpipe.pipeline.mcap.writer import McapWriter

_qos_text = cache(qos_to_yaml)


@dataclass(frozen=True)
class BagSplit:
    """When a bag goes on in another file: after so much time, or so many bytes of messages.

    Bytes count before compression, so that the same messages are always split at the same ones. None: never.
    """

    after_s: float | None = None
    after_mb: float | None = None

    @classmethod
    def of(cls, provenance: Provenance) -> BagSplit:
        """As the scenario in a drive's provenance says; an adversarial bag is split like its clean one."""
        try:
            scenario = read_yaml(provenance.get("scenario") or "{}", dict, "the provenance", "")
        except AdvpipeError:
            return cls()
        recording = scenario.get("recording")
        given = [recording.get(key) for key in ("split_s", "split_mb")] if isinstance(recording, dict) else []
        return cls(*(one if isinstance(one, int | float) and one > 0 else None for one in given))


class BagPart:
    """A file in the making; topics are defined anew in each.

    bytes: of its messages before compression. count, first_ns, last_ns: of its messages.
    """

    def __init__(self, path: Path, compression: str, provenance: Mapping[str, str]) -> None:
        self.path = path
        self.bytes, self.count = 0, 0
        self.first_ns: int | None = None
        self.last_ns = 0
        self._schema_ids: dict[tuple[str, str], int] = {}
        self._channel_ids: dict[str, int] = {}
        self._file: IO[bytes] = path.open("wb")
        self.mcap = McapWriter(self._file, compression)
        self.mcap.add_metadata(RECORD_NAME, provenance)

    def is_full(self, split: BagSplit, log_ns: int, length: int) -> bool:
        """Whether a message of this time and length belongs to the next file."""
        if self.first_ns is None:
            return False
        if split.after_s is not None and log_ns - self.first_ns >= split.after_s * 1e9:
            return True
        return split.after_mb is not None and self.bytes + length > split.after_mb * 1e6

    def add(self, raw: RawMessage, type_hash: str) -> None:
        """Append a message; its topic is defined before the first one."""
        name = raw.topic.name
        if name not in self._channel_ids:
            self._channel_ids[name] = self._new_channel(raw, type_hash)
        channel_id, log_ns = self._channel_ids[name], raw.log_time_ns
        self.mcap.add_message(channel_id, log_ns, raw.cdr, raw.publish_time_ns, raw.sequence)
        self.count += 1
        self.bytes += len(raw.cdr)
        self.first_ns = log_ns if self.first_ns is None else min(self.first_ns, log_ns)
        self.last_ns = max(self.last_ns, log_ns)

    def finish(self, information: str) -> None:
        """Write the rest; information: rosbag2's metadata of the bag up to here."""
        self.mcap.add_metadata("rosbag2", {"serialized_metadata": information})
        self.mcap.finish()
        self._file.close()

    def abort(self) -> None:
        """Stop writing."""
        try:
            self.mcap.abort()
        finally:
            with suppress(OSError):  # a full disk: what the buffer still holds is lost with the folder
                self._file.close()

    def _new_channel(self, raw: RawMessage, type_hash: str) -> int:
        topic, schema = raw.topic, raw.schema
        if (schema_id := self._schema_ids.get((topic.type, schema))) is None:
            schema_id = self.mcap.add_schema(topic.type, raw.schema_encoding, schema.encode())
            self._schema_ids[topic.type, schema] = schema_id
        metadata = {"offered_qos_profiles": _qos_text(topic.qos), "topic_type_hash": type_hash}
        return self.mcap.add_channel(topic.name, schema_id, metadata)
