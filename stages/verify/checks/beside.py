"""Whether the files beside a bag are those that the bag remembers."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.writer import FILES_RECORD
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Gap, Result


class FilesBeside(BagCheck):
    """The bag holds the SHA-256 of its labels and of attack.yaml: it protects them without SHA256SUMS."""

    def check(self) -> Iterator[Result]:
        if self.bag.path.is_file() or not self.bag.provenance:
            return
        told: dict[str, str] = {}
        for walk in self.bag.walks:
            told |= walk.records.get(FILES_RECORD, {})
        present = {
            path.name: path
            for path in sorted(self.bag.path.iterdir())
            if path.is_file() and path.suffix != ".mcap" and path.name != METADATA_NAME
        }
        subject = self.bag.subject
        for name in sorted(told.keys() | present.keys()):
            where = f"{self.bag.place}/{name}"
            if name not in present:
                yield Fault(where, "is missing, though the bag remembers it")
            elif name in told and subject.scan(present[name]).sha256 != told[name]:
                yield Fault(where, "is not the file that the bag remembers (SHA-256)")
            elif name not in told and not subject.has_sums:
                yield Gap(where, "no checksum protects it")
