"""What `verify` finds, by the names of its checks."""

from __future__ import annotations

from pathlib import Path

from advpipe.stages.verify.run import verify


def checks_of(path: Path) -> set[str]:
    return {finding.check for finding in verify(path).findings}
