"""The names of leftovers of killed runs: hidden names that contain the final name."""

from __future__ import annotations

import re

from advpipe.pipeline.core.atomic_file import MARK

PATTERNS = {
    "output": re.compile(r"\.(.+)\.partial-[a-z0-9_]{8}", re.DOTALL),
    "job": re.compile(r"\.(.+)\.([0-9a-f]{12})\.job", re.DOTALL),
    "file": re.compile(rf"\.(.+){re.escape(MARK)}[0-9a-f]{{8}}", re.DOTALL),
}
"""Patterns by type of leftover; the first group is the final name. output: a folder of `PartialFolder`. job:
finished frames of an attack or import, with a hash of the request. file: a hidden file of `atomic_file`."""


def is_leftover_name(name: str) -> bool:
    """Whether a file or folder of this name may be a leftover of a killed run."""
    return name.startswith(".") and any(pattern.fullmatch(name) for pattern in PATTERNS.values())
