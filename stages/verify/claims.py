"""What the end of an .mcap file says about the rest of it."""

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

from advpipe.pipeline.mcap.records import Record, parse

if TYPE_CHECKING:
    from advpipe.stages.verify.walk import Walk


def check_claims(walk: Walk, records: Iterable[Record], summary_start: int) -> None:
    """Compare the summary with what was read; differences become faults of the walk.

    summary_start: where the data section ended. A summary may leave things out, as the format allows; what it
    says has to be so.
    """
    told: list[McapRecord] = []
    groups: list[SummaryOffset] = []
    offset_start, footer = 0, None
    for record in records:
        parsed = parse(record.opcode, record.body)
        if parsed is None:
            walk.faults.append(f"a record of kind {record.opcode:#04x} lies in the summary")
            continue
        walk.check_bytes(record, parsed)
        length = record.end - record.start
        if footer is not None:
            walk.faults.append("there are records behind the footer")
        if isinstance(parsed, Footer):
            footer = parsed
            continue
        if isinstance(parsed, SummaryOffset):
            offset_start = offset_start or record.start
        elif groups and groups[-1].group_opcode == record.opcode:
            groups[-1].group_length += length
        else:
            groups.append(SummaryOffset(record.opcode, record.start, length))
        told.append(parsed)
    if footer is None:
        walk.faults.append("the footer is missing")
        return
    if footer.summary_start != (summary_start if told else 0):
        walk.faults.append("the footer names another place for the summary")
    if footer.summary_offset_start != offset_start:
        walk.faults.append("the footer names another place for the summary's offsets")
    offsets = [one for one in told if isinstance(one, SummaryOffset) and one.group_length]
    if offsets and _by_start(offsets) != _by_start(groups):
        walk.faults.append("the summary's offsets are not those of its groups")
    _compare(walk, told)


def _by_start(offsets: list[SummaryOffset]) -> list[tuple[int, int, int]]:
    return sorted((one.group_start, one.group_opcode, one.group_length) for one in offsets)


def _compare(walk: Walk, told: list[McapRecord]) -> None:
    for schema in (one for one in told if isinstance(one, Schema)):
        if walk.schemas.get(schema.id) != schema:
            walk.faults.append(f"the summary has another schema {schema.id} than the data")
    for channel in (one for one in told if isinstance(one, Channel)):
        if walk.channels.get(channel.id, channel) != channel:
            walk.faults.append(f"the summary has another channel {channel.id} than the data")
    indexes = sorted((c for c in told if isinstance(c, ChunkIndex)), key=lambda c: c.chunk_start_offset)
    if indexes and indexes != walk.chunks:
        walk.faults.append("the summary's index of chunks is not that of the chunks")
    metadata = sorted((m for m in told if isinstance(m, MetadataIndex)), key=lambda m: m.offset)
    if metadata and metadata != walk.metadata:
        walk.faults.append("the summary's index of metadata is not that of the records")
    attached = sum(isinstance(one, AttachmentIndex) for one in told)
    if attached not in (0, walk.attachments):
        walk.faults.append(f"the summary lists {attached} attachments, {walk.attachments} are there")
    for statistics in (one for one in told if isinstance(one, Statistics)):
        _compare_statistics(walk, statistics, {one.id for one in told if isinstance(one, Schema)})


def _compare_statistics(walk: Walk, told: Statistics, schema_ids: set[int]) -> None:
    real = {
        "message_count": sum(walk.counts.values()),
        "schema_count": len(schema_ids | set(walk.schemas)),
        "chunk_count": len(walk.chunks),
        "metadata_count": len(walk.metadata),
        "attachment_count": walk.attachments,
        "message_start_time": walk.first_ns or 0,
        "message_end_time": walk.last_ns or 0,
    }
    for name, number in real.items():
        if getattr(told, name) != number:
            walk.faults.append(f"the statistics say {name} {getattr(told, name)}, it is {number}")
    counts = {key: count for key, count in told.channel_message_counts.items() if count}
    if counts != walk.counts:
        walk.faults.append("the statistics count other messages of a channel than there are")
    if told.channel_count < len(walk.channels):
        walk.faults.append(f"the statistics say channel_count {told.channel_count}: {len(walk.channels)}")
