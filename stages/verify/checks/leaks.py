"""Whether anything but the attacks themselves tells what they touched."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.audit.run import audit
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked

CLOUDS = 20
"""Clouds of a bag that are measured, at most."""


class Leaks(FolderCheck):
    """Audits a data set by itself, as `advpipe audit` does without another drive to learn from."""

    def check(self) -> Iterator[Result]:
        layout = self.subject.layout
        try:
            if layout is None or not any(bag.is_attack for bag in self.subject.bags):
                return
            found = audit([layout.folder], most_clouds=CLOUDS)
        except AdvpipeError as error:
            yield Unchecked(self.subject.root.name, f"not audited: {error}")
            return
        yield from (Fault(self.subject.root.name, str(finding)) for finding in found.findings)
