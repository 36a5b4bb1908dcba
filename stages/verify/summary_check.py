"""Compare the summary of an .mcap file with its data section."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Footer,
    McapRecord,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from advpipe.pipeline.mcap.records import Record, parse_record

if TYPE_CHECKING:
    from advpipe.stages.verify.mcap_scanner import McapScanner


def check_summary(scanner: McapScanner, records: Iterable[Record], summary_start: int) -> None:
    """Compare the summary with the records that were read; differences become faults of the scanner.

    summary_start: offset of the data section's end. The format allows a summary to omit records, but those in
    it must be correct.
    """
    stated: list[McapRecord] = []
    groups: list[SummaryOffset] = []
    offset_start, footer = 0, None
    for record in records:
        parsed = parse_record(record.opcode, record.body)
        if parsed is None:
            scanner.faults.append(f"the summary holds an unknown record, opcode {record.opcode:#04x}")
            continue
        scanner.check_bytes(record, parsed)
        length = record.end - record.start
        if footer is not None:
            scanner.faults.append("there are records after the footer")
        if isinstance(parsed, Footer):
            footer = parsed
            continue
        if isinstance(parsed, SummaryOffset):
            offset_start = offset_start or record.start
        elif groups and groups[-1].group_opcode == record.opcode:
            groups[-1].group_length += length
        else:
            groups.append(SummaryOffset(record.opcode, record.start, length))
        stated.append(parsed)
    if footer is None:
        scanner.faults.append("the footer is missing")
        return
    if footer.summary_start != (summary_start if stated else 0):
        scanner.faults.append("the footer states a wrong offset of the summary")
    if footer.summary_offset_start != offset_start:
        scanner.faults.append("the footer states a wrong offset of the summary offsets")
    offsets = [record for record in stated if isinstance(record, SummaryOffset) and record.group_length]
    if offsets and _by_start(offsets) != _by_start(groups):
        scanner.faults.append("the summary offsets do not match its groups")
    _compare(scanner, stated)


def _by_start(offsets: list[SummaryOffset]) -> list[tuple[int, int, int]]:
    return sorted((record.group_start, record.group_opcode, record.group_length) for record in offsets)


def _compare(scanner: McapScanner, stated: list[McapRecord]) -> None:
    for schema in (record for record in stated if isinstance(record, Schema)):
        if scanner.schemas.get(schema.id) != schema:
            scanner.faults.append(f"the summary and the data section define schema {schema.id} differently")
    for channel in (record for record in stated if isinstance(record, Channel)):
        if scanner.channels.get(channel.id, channel) != channel:
            scanner.faults.append(f"the summary and the data section define channel {channel.id} differently")
    indexes = sorted((c for c in stated if isinstance(c, ChunkIndex)), key=lambda c: c.chunk_start_offset)
    if indexes and indexes != scanner.chunks:
        scanner.faults.append("the summary's chunk index does not match the chunks")
    metadata = sorted((m for m in stated if isinstance(m, MetadataIndex)), key=lambda m: m.offset)
    if metadata and metadata != scanner.metadata:
        scanner.faults.append("the summary's metadata index does not match the records")
    attached = sum(isinstance(record, AttachmentIndex) for record in stated)
    if attached not in (0, scanner.attachments):
        scanner.faults.append(
            f"the summary lists {attached} attachments, but there are {scanner.attachments}"
        )
    for statistics in (record for record in stated if isinstance(record, Statistics)):
        _compare_statistics(
            scanner, statistics, {record.id for record in stated if isinstance(record, Schema)}
        )


def _compare_statistics(scanner: McapScanner, stated: Statistics, schema_ids: set[int]) -> None:
    real = {
        "message_count": sum(scanner.counts.values()),
        "schema_count": len(schema_ids | set(scanner.schemas)),
        "chunk_count": len(scanner.chunks),
        "metadata_count": len(scanner.metadata),
        "attachment_count": scanner.attachments,
        "message_start_time": scanner.first_ns or 0,
        "message_end_time": scanner.last_ns or 0,
    }
    for name, number in real.items():
        if getattr(stated, name) != number:
            scanner.faults.append(f"the statistics state {name} {getattr(stated, name)}, but it is {number}")
    counts = {key: count for key, count in stated.channel_message_counts.items() if count}
    if counts != scanner.counts:
        scanner.faults.append("the statistics state a wrong message count for a channel")
    if stated.channel_count < len(scanner.channels):
        scanner.faults.append(
            f"the statistics state channel_count {stated.channel_count}, but it is {len(scanner.channels)}"
        )
