"""The names of what killed runs leave: hidden, and each with the name that it was to get."""

from __future__ import annotations

import re

from advpipe.pipeline.core.atomic_file import MARK

PATTERNS = {
    "output": re.compile(r"\.(.+)\.partial-[a-z0-9_]{8}", re.DOTALL),
    "job": re.compile(r"\.(.+)\.([0-9a-f]{12})\.job", re.DOTALL),
    "file": re.compile(rf"\.(.+){re.escape(MARK)}[0-9a-f]{{8}}", re.DOTALL),
}
"""By kind; the first group is the final name. output: a folder of `PartialFolder`. job: finished frames of an
attack, and a hash of what was asked for. file: of `whole_file`."""


def is_leftover_name(name: str) -> bool:
    """Whether something may be a leftover, going by its name."""
    return name.startswith(".") and any(pattern.fullmatch(name) for pattern in PATTERNS.values())
