"""Writes a consistent bag with other messages and another provenance record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path

from advpipe.pipeline.bag.provenance import RECORD_NAME, with_checksum
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.qos import qos_to_yaml
from advpipe.pipeline.mcap.writer import McapWriter


class BagDocument:
    """The messages and the provenance of a valid bag."""

    def __init__(self, bag: Path) -> None:
        reader = BagReader(bag)
        self.provenance = reader.provenance
        self.messages = list(reader.raw_messages())

    def of_topic(self, name: str) -> list[int]:
        """Places of a topic's messages."""
        return [place for place, raw in enumerate(self.messages) if raw.topic.name == name]

    @property
    def topics(self) -> list[str]:
        return sorted({raw.topic.name for raw in self.messages})


def mcap_bytes(messages: Iterable[RawMessage], provenance: Mapping[str, str]) -> bytes:
    """The .mcap file of a bag, its checksums right; messages in any order, uncompressed."""
    stream = BytesIO()
    writer = McapWriter(stream, "none")
    writer.add_metadata(RECORD_NAME, with_checksum(provenance))
    channels: dict[tuple[str, str], int] = {}
    for raw in messages:
        key = raw.topic.name, raw.schema
        if key not in channels:
            schema = writer.add_schema(raw.topic.type, raw.schema_encoding, raw.schema.encode())
            about = {
                "offered_qos_profiles": qos_to_yaml(raw.topic.qos),
                "topic_type_hash": raw.topic.type_hash,
            }
            channels[key] = writer.add_channel(raw.topic.name, schema, about)
        writer.add_message(channels[key], raw.log_time_ns, raw.cdr, raw.publish_time_ns, raw.sequence)
    writer.finish()
    return stream.getvalue()
