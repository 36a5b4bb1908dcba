"""Whether the checksums in .mcap files are right: those that cover every byte as it is stored."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.bag.checksums import validate_checksums
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.progress import track
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Gap, Result


class Crcs(FolderCheck):
    """Data section and summary. Where a recorder left those out, chunks are unpacked for their own."""

    def check(self) -> Iterator[Result]:
        files = [(bag, file) for bag in self.subject.bags for file in bag.files]
        for bag, file in track(files, "checksums"):
            found = self.subject.scan(file)
            yield from (Fault(self.subject.place(file), fault) for fault in found.faults)
            if found.faults or found.covered:
                continue
            try:
                coverage = validate_checksums(file)
            except AdvpipeError as error:
                yield Fault(self.subject.place(file), str(error))
                continue
            if not self.subject.has_sums:
                yield Gap(self.subject.place(file), f"checksums of {bag.place}: {coverage}")
