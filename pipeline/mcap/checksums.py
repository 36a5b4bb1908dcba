"""Validates every checksum of an MCAP file and states how much of it they cover."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.mcap.reader import mcap_errors
from advpipe.pipeline.mcap.records import HEAD, parse_chunk, parse_record, read_records
from advpipe.pipeline.mcap.unpacking import UnpackBudget


@dataclass(frozen=True)
class ChecksumCoverage:
    """How much of one or several files is covered by checksums, all of which are valid."""

    chunks: int = 0
    chunks_covered: int = 0
    files: int = 0
    data_sections_covered: int = 0
    summaries_covered: int = 0

    def __add__(self, other: ChecksumCoverage) -> ChecksumCoverage:
        return ChecksumCoverage(
            self.chunks + other.chunks,
            self.chunks_covered + other.chunks_covered,
            self.files + other.files,
            self.data_sections_covered + other.data_sections_covered,
            self.summaries_covered + other.summaries_covered,
        )

    def __str__(self) -> str:
        if not self.chunks_covered and not self.data_sections_covered:
            return "none in the bag: damage would go unnoticed"
        return (
            f"valid; they cover {self.chunks_covered} of {self.chunks} chunks, "
            f"{self.data_sections_covered} of "
            f"{self.files} data sections, {self.summaries_covered} of {self.files} summaries"
        )


def validate_checksums(path: Path) -> ChecksumCoverage:
    """Read a whole .mcap file and validate its checksums, except the summary's, which McapFile validates.

    Raises AdvpipeError for a wrong checksum and for a damaged file.
    """
    chunks = covered = data_sections = summaries = 0
    magic_bytes = len(MCAP0_MAGIC)
    with mcap_errors(path), path.open("rb") as stream:
        end, crc = stream.seek(0, 2) - magic_bytes, zlib.crc32(MCAP0_MAGIC)
        budget = UnpackBudget(end)
        for record in read_records(stream, magic_bytes, end):
            if record.opcode == Opcode.CHUNK:
                chunk = parse_chunk(record.body)
                budget.unpack(chunk)
                chunks += 1
                covered += chunk.uncompressed_crc != 0
            parsed = parse_record(record.opcode, record.body)
            if isinstance(parsed, DataEnd):
                if parsed.data_section_crc not in (0, crc):
                    raise ValueError("crc validation failed in DataEnd")
                data_sections += parsed.data_section_crc != 0
            elif isinstance(parsed, Footer):
                summaries += parsed.summary_crc != 0
            crc = zlib.crc32(record.body, zlib.crc32(HEAD.pack(record.opcode, len(record.body)), crc))
    return ChecksumCoverage(chunks, covered, 1, data_sections, summaries)
