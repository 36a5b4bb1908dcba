"""What an MCAP file says about itself: its summary, its metadata records, its data section."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Metadata, MetadataIndex, Schema, Statistics
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.mcap.records import Record, parse_record, read_records

FOOTER_BYTES = 29
METADATA_LIMIT_BYTES = 1 << 24
"""The longest metadata record that is read: a scenario has some 10 kB."""

_DATA = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END)
_IN_SUMMARY = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.METADATA_INDEX)


def read_summary(stream: IO[bytes]) -> Summary | None:
    """What the end of a whole file says about it; None where that says nothing."""
    end = stream.seek(0, 2) - len(MCAP0_MAGIC)
    footer = next(read_records(stream, end - FOOTER_BYTES, end))
    parsed = parse_record(footer.opcode, footer.body)
    if not isinstance(parsed, Footer):
        raise ValueError("the footer is missing")
    if not parsed.summary_start:
        return None
    summary = Summary()
    for record in read_records(stream, parsed.summary_start, footer.start, _IN_SUMMARY):
        add_definition(summary, parse_record(record.opcode, record.body) if record.body else None)
    return summary


def add_definition(summary: Summary, record: object) -> None:
    """Sort a record into a summary."""
    if isinstance(record, Schema):
        summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        summary.channels[record.id] = record
    elif isinstance(record, Statistics):
        summary.statistics = record
    elif isinstance(record, ChunkIndex):
        summary.chunk_indexes.append(record)
    elif isinstance(record, MetadataIndex):
        summary.metadata_indexes.append(record)


def read_metadata(stream: IO[bytes], summary: Summary | None) -> dict[str, dict[str, str]]:
    """The metadata records by name, by their index; without a summary, by reading through the file."""
    if summary is None:
        records = data_records(stream, (Opcode.METADATA,))
    else:
        places = [(index.offset, index.offset + index.length) for index in summary.metadata_indexes]
        records = (next(read_records(stream, *place)) for place in places)
    found: dict[str, dict[str, str]] = {}
    for record in records:
        if len(record.body) > METADATA_LIMIT_BYTES:
            raise ValueError(f"the metadata record at {record.start} has {len(record.body)} bytes")
        parsed = parse_record(record.opcode, record.body) if record.opcode == Opcode.METADATA else None
        if isinstance(parsed, Metadata):
            found[parsed.name] = parsed.metadata
    return found


def data_records(stream: IO[bytes], wanted: Collection[int] = _DATA) -> Iterator[Record]:
    """The records of the data section."""
    end = stream.seek(0, 2) - len(MCAP0_MAGIC)
    for record in read_records(stream, len(MCAP0_MAGIC), end, wanted):
        if record.opcode == Opcode.DATA_END:
            return
        yield record
