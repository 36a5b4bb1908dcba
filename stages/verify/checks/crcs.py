"""Whether the checksums in .mcap files that cover the stored bytes are correct."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.mcap.checksums import validate_checksums
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked


class Crcs(FolderCheck):
    """Checks the data section and the summary, or the chunks of a file without those checksums."""

    def check(self) -> Iterator[Result]:
        for bag in track(self.subject.bags, "checksums"):
            try:
                files = bag.files
            except AdvpipeError as error:
                yield Fault(bag.place, str(error))
                continue
            for file in files:
                try:
                    yield from self._check_file(file, bag.place)
                except AdvpipeError as error:
                    yield Fault(self.subject.place(file), str(error))

    def _check_file(self, file: Path, bag: str) -> Iterator[Result]:
        found, where = self.subject.scan(file), self.subject.place(file)
        yield from (Fault(where, fault) for fault in found.faults)
        if not found.faults and not found.covered:
            coverage = validate_checksums(file)
            if not self.subject.has_sums:
                yield Unchecked(where, f"checksums of {bag}: {coverage}")
