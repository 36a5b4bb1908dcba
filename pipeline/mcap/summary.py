"""Reads the summary, the metadata records and the data section of an MCAP file."""

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
"""The longest metadata record that is read; a scenario has some 10 kB."""

_DATA = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END)
_IN_SUMMARY = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.METADATA_INDEX)


def read_summary(stream: IO[bytes]) -> Summary | None:
    """Read the summary of a complete file; None if it has none. Raises ValueError for a missing footer."""
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
    """Add a record to a summary; records of types that a summary does not hold are ignored."""
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
    """Read the metadata records, by name, through the summary's index; without a summary, scan the file.

    Raises ValueError for a record of more than `METADATA_LIMIT_BYTES`.
    """
    if summary is None:
        records = data_records(stream, (Opcode.METADATA,))
    else:
        spans = [(index.offset, index.offset + index.length) for index in summary.metadata_indexes]
        records = (next(read_records(stream, *span)) for span in spans)
    found: dict[str, dict[str, str]] = {}
    for record in records:
        if len(record.body) > METADATA_LIMIT_BYTES:
            raise ValueError(f"the metadata record at {record.start} has {len(record.body)} bytes")
        parsed = parse_record(record.opcode, record.body) if record.opcode == Opcode.METADATA else None
        if isinstance(parsed, Metadata):
            found[parsed.name] = parsed.metadata
    return found


def data_records(stream: IO[bytes], wanted: Collection[int] = _DATA) -> Iterator[Record]:
    """Yield the records of the data section; the bodies of records with other opcodes are skipped."""
    end = stream.seek(0, 2) - len(MCAP0_MAGIC)
    for record in read_records(stream, len(MCAP0_MAGIC), end, wanted):
        if record.opcode == Opcode.DATA_END:
            return
        yield record
