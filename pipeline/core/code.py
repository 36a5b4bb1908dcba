"""Identifies the code that made a result, so that results of two versions of it are not mixed."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[2]

LABELS = tuple(
    f"pipeline/labels/{name}.py"
    for name in ("points", "cloud_change", "cloud_quantity", "quantities", "quantity")
)

CLOUDS = (
    "pipeline/messages/cloud.py",
    "pipeline/core/frame_slice.py",
    "pipeline/bag/frame_reader.py",
    "pipeline/bag/frames.py",
    "pipeline/bag/ground_truth.py",
    "pipeline/bag/lidar_mount.py",
    "pipeline/bag/uncounted.py",
    "pipeline/messages/labels.py",
    "pipeline/adversary",
    "pipeline/attack_detection",
    "pipeline/defences",
    "pipeline/baselines.py",
    "pipeline/detector",
    "pipeline/geometry",
    *LABELS,
    "pipeline/metrics",
    "pipeline/core/compiled.py",
    "pipeline/core/index_ranges.py",
    "pipeline/core/seeding.py",
)
"""The code that decides how clouds are read, how objects are detected in them, how these are
scored, and how a random baseline is drawn."""


@cache
def code_sha256(*parts: str) -> str:
    """SHA-256 (hexadecimal) of the Python and C sources in `parts`, files and folders below the package.

    It covers the path and the text of each source, sorted by path, with line endings normalised. It is
    computed once in a process, as the code is loaded once. Raises FileNotFoundError for a missing part.
    """
    digest = hashlib.sha256()
    for source in sorted({source for part in parts for source in _sources(PACKAGE / part)}):
        text = source.read_text(encoding="utf-8")
        name = source.relative_to(PACKAGE).as_posix()
        digest.update(f"{name}\0{len(text)}\0{text}".encode())
    return digest.hexdigest()


@cache
def source_commit() -> str | None:
    """The git commit of this package's sources, with a trailing `+` where the code differs from it.

    None outside a checkout. A package in site-packages is not a checkout, even if that folder lies inside the
    checkout of another project.
    """
    if not (PACKAGE / ".git").exists():
        return None
    try:
        commit = _git("rev-parse", "HEAD")
        return f"{commit}+" if _git("status", "--porcelain", "--", "*.py", "*.c") else commit
    except (OSError, subprocess.CalledProcessError):  # git is not installed, or there is no commit yet
        return None


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(PACKAGE), *arguments]
    return subprocess.run(command, check=True, capture_output=True, encoding="utf-8").stdout.strip()


def _sources(part: Path) -> list[Path]:
    found = [part] if part.is_file() else [*part.rglob("*.py"), *part.rglob("*.c")]
    if not found:
        raise FileNotFoundError(part)
    return found
