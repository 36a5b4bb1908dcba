"""Whether every file is the one that SHA256SUMS lists, and none is missing or unlisted."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.layout import is_hidden
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked


class Checksums(FolderCheck):
    """SHA-256 of every file; without a list, that is said."""

    def check(self) -> Iterator[Result]:
        root = self.subject.root
        if not self.subject.has_sums:
            yield Unchecked(
                root.name, f"no {checksums.FILE}: files are only checked against their own checksums"
            )
            return
        try:
            present = checksums.listed_files(root)
            sums = checksums.read(root)
        except AdvpipeError as error:
            yield Fault(checksums.FILE, str(error))
            return
        for name in sorted(sums.keys() - set(present)):
            yield Fault(name, "is missing")
        left = self.subject.layout.leftovers if self.subject.layout is not None else ()
        for name in sorted(set(present) - sums.keys()):
            if any(leftover.holds(root / name) for leftover in left):  # already reported
                continue
            if is_hidden(name):  # of the system or of what fetched the data set; sharing takes none
                yield Unchecked(root.name, f"{name} is hidden and not listed; not part of the data set")
            else:
                yield Fault(name, f"is not listed in {checksums.FILE}")
        for name in track([name for name in present if name in sums], "hashing"):
            try:
                if self.subject.scan(root / name).sha256 != sums[name]:
                    yield Fault(name, f"does not match its SHA-256 in {checksums.FILE}")
            except AdvpipeError as error:
                yield Fault(name, str(error))
