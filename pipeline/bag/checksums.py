"""Validate every checksum of an MCAP file, and say how much of it they cover."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader, breakup_chunk

from advpipe.pipeline.bag.mcap_file import mcap_errors


@dataclass(frozen=True)
class ChecksumCoverage:
    """How much of some files is covered by checksums, all of which are right."""

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
            return "none in the bag: damage would go unseen"
        return (
            f"valid; cover {self.chunks_covered} of {self.chunks} chunks, {self.data_sections_covered} of "
            f"{self.files} data sections, {self.summaries_covered} of {self.files} summaries"
        )


def validate_checksums(path: Path) -> ChecksumCoverage:
    """Read a whole .mcap file; a wrong checksum raises AdvpipeError. (McapFile checks the summary's.)"""
    chunks = covered = data_sections = summaries = 0
    with mcap_errors(path), path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True, validate_crcs=True).records:
            if isinstance(record, Chunk):
                breakup_chunk(record, validate_crc=True)
                chunks += 1
                covered += record.uncompressed_crc != 0
            elif isinstance(record, DataEnd):
                data_sections += record.data_section_crc != 0
            elif isinstance(record, Footer):
                summaries += record.summary_crc != 0
    return ChecksumCoverage(chunks, covered, 1, data_sections, summaries)
