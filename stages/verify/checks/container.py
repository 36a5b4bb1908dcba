"""Whether .mcap files are sound: records, chunks, indexes and counts agree, and no byte is left over."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result


class Container(BagCheck):
    """Reports what the scanners found."""

    def check(self) -> Iterator[Result]:
        for scanner in self.bag.scanners:
            yield from (Fault(self.bag.subject.place(scanner.path), fault) for fault in scanner.faults)
