"""Which state of this package's own code made a result: results of two states must not be mixed unseen."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]

CLOUDS = (
    "pipeline/bag/cloud.py",
    "pipeline/bag/frame_slice.py",
    "pipeline/bag/frames.py",
    "pipeline/bag/ground_truth.py",
    "pipeline/baselines.py",
    "pipeline/detector",
    "pipeline/geometry",
    "pipeline/metrics",
    "pipeline/seeding.py",
)
"""What decides how clouds are read, detected in and scored."""


@cache
def code_sha256(*parts: str) -> str:
    """SHA-256 over the Python sources in `parts`: files and folders of this package, named from its root.

    Of each source its path and its text count, in the order of paths; line ends do not. It is computed
    once in a process, as the code is loaded once. Raises FileNotFoundError for a part that is none.
    """
    digest = hashlib.sha256()
    for source in sorted({source for part in parts for source in _sources(PACKAGE / part)}):
        text = source.read_text(encoding="utf-8")
        name = source.relative_to(PACKAGE).as_posix()
        digest.update(f"{name}\0{len(text)}\0{text}".encode())
    return digest.hexdigest()


def _sources(part: Path) -> list[Path]:
    found = [part] if part.is_file() else list(part.rglob("*.py"))
    if not found:
        raise FileNotFoundError(part)
    return found
