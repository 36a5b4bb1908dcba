"""What killed runs left: hidden folders and files of advpipe, found, described and removed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from advpipe.pipeline.bag.partial_recording import find_partial_recording
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.leftover_names import PATTERNS, is_leftover_name
from advpipe.pipeline.core.lock import HAS_LOCKS, LOCK_NAME, is_locked, one_at_a_time, take_stale_lock
from advpipe.pipeline.core.partial import MOVING_NAME, REPLACED_NAME
from advpipe.pipeline.core.scratch import FILES_NAME, PREFIX
from advpipe.pipeline.mcap.salvage import Salvage

MOST_LEVELS = 100
"""How deep below a root leftovers are looked for."""

ATTACK_NAME, SOURCE_NAME, CHECKSUMS_NAME = "attack.yaml", "source.yaml", "SHA256SUMS"

_WHOLE = (
    "metadata.yaml",
    "scenario.yaml",
    "source.yaml",
    "report.json",
    "attacks.json",
    "key.json",
    CHECKSUMS_NAME,
)
"""Files of whole outputs, which are without a lock for the instant before they get their names."""

_SCRATCH = re.compile(rf"{PREFIX}[a-z0-9_]{{8}}")
_FRAME = re.compile(r"[0-9]{6,}\.npz")
_PART = re.compile(r"([0-9]{8,})-([0-9]{8,})")
"""Of an import: from which frame to which."""


@dataclass(frozen=True)
class Leftover:
    """A hidden folder or file of a run that was killed, or that is still at work.

    kind: output (half-written), job (finished frames of an attack or import), file (half-written), or scratch
    (temporary files). final: what it was to become or belongs to; of scratch, the folder itself.
    """

    path: Path
    kind: str
    final: Path

    @cached_property
    def is_running(self) -> bool:
        """Whether a living run holds it."""
        return is_locked(self._lock)

    def holds(self, path: Path) -> bool:
        """Whether a path is it or lies in it."""
        return path.is_relative_to(self.path)

    @property
    def _lock(self) -> Path:
        return self.path if self.kind == "file" else self.path / LOCK_NAME

    @cached_property
    def size_bytes(self) -> int:
        """Of all files in it."""
        return _size_bytes(self.path)

    @cached_property
    def use(self) -> str | None:
        """What could still use it: `recover`, a run that goes on from it (`resume`), or a user who wants the
        former output back (`restore`). None where nothing can."""
        if self.kind == "job":
            return "resume" if self.frames and not self._is_finished else None
        if self.kind != "output":
            return None
        if (self.path / MOVING_NAME).is_file():
            return "resume"
        if (self.path / REPLACED_NAME).is_dir():
            return "restore"
        return "recover" if _is_recording(self.path) else None

    @cached_property
    def frames(self) -> int:
        """How many finished frames a job holds."""
        with suppress(OSError), os.scandir(self.path) as entries:
            return sum(_frames_in(entry.name) for entry in entries)
        return 0

    @property
    def _is_finished(self) -> bool:
        """Whether the bag of just this job is there: attack.yaml is the request that the job is named for."""
        match = PATTERNS["job"].fullmatch(self.path.name)
        with suppress(OSError):  # an import: what its last part was before, the drive was made of it
            made_ns = (self.final / SOURCE_NAME).stat().st_mtime_ns
            parts = [part for part in self.path.iterdir() if _PART.fullmatch(part.name)]
            return bool(parts) and all(part.stat().st_mtime_ns <= made_ns for part in parts)
        with suppress(OSError):
            request = (self.final / ATTACK_NAME).read_bytes()
            return match is not None and hashlib.sha256(request).hexdigest().startswith(match[2])
        return False

    def remove(self) -> bool:
        """Remove it, unless a living run holds it or it is gone. Raises OSError where that is refused."""
        if not HAS_LOCKS:
            raise AdvpipeError(
                f"{self.path}: this system has no file locks to tell running from killed runs; remove "
                "it by hand"
            )
        # Folders are made and locked under their parent's lock, temporary ones are not.
        with nullcontext() if self.kind == "scratch" else one_at_a_time(self.path.parent):
            if self.kind != "scratch" and recognise(self.path) is None:
                return False
            lock = take_stale_lock(self._lock)
            if lock is None and is_locked(self._lock):
                return False
            try:
                if self.kind == "file":
                    self.path.unlink()
                else:
                    shutil.rmtree(self.path)
            finally:
                if lock is not None:
                    lock.close()
        return True


def _frames_in(name: str) -> int:
    """How many frames a file or folder of a job holds, by its name."""
    if part := _PART.fullmatch(name):
        return max(0, int(part[2]) - int(part[1]))
    return int(_FRAME.fullmatch(name) is not None)


def recognise(path: Path) -> Leftover | None:
    """The leftover that a path is, by its name and by what is in it; None for anything else."""
    name = path.name
    for kind, pattern in PATTERNS.items():
        if match := pattern.fullmatch(name):
            is_ours = _is(path, stat.S_ISREG) if kind == "file" else _is_our_folder(path)
            return Leftover(path, kind, path.with_name(match[1])) if is_ours else None
    return None


def find_leftovers(
    root: Path, too_deep: Callable[[int, Path], None] = lambda level, folder: None
) -> Iterator[Leftover]:
    """All leftovers below a folder, or the one that it is; other hidden folders and links are left out.

    What waits to be looked at is held in memory, not what was found. Folders that cannot be read have no
    leftovers. too_deep: is called with each folder and its level, and may raise an error of its own.
    """
    if (own := recognise(root)) is not None:
        yield own
        return
    stack = [(root, 0)]
    while stack:
        folder, level = stack.pop()
        too_deep(level, folder)
        hidden, below = [], []
        with suppress(OSError), os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.startswith("."):
                    hidden += [entry.name] if is_leftover_name(entry.name) else []
                elif level <= MOST_LEVELS and entry.is_dir(follow_symlinks=False):
                    below.append(entry.name)
        yield from filter(None, (recognise(folder / name) for name in sorted(hidden)))
        stack += [(folder / name, level + 1) for name in sorted(below, reverse=True)]


def find_scratch() -> Iterator[Leftover]:
    """Temporary files of this user's runs, in the system's folder for them."""
    root = Path(tempfile.gettempdir())
    with suppress(OSError), os.scandir(root) as entries:
        for entry in entries:
            path = root / entry.name
            if _SCRATCH.fullmatch(entry.name) and _is(path, stat.S_ISDIR) and _is_scratch(path):
                yield Leftover(path, "scratch", path)


def refuse_inside(root: Path) -> None:
    """Raises UsageError for a path inside a leftover: it is shown and removed as a whole."""
    for parent in root.resolve().parents:
        if recognise(parent) is not None:
            raise UsageError(
                f"{root} is inside {parent}, which belongs to a killed or running run; give that folder"
            )


def _is(path: Path, is_type: Callable[[int], bool]) -> bool:
    try:
        return is_type(path.lstat().st_mode)
    except OSError:
        return False


def _is_our_folder(path: Path) -> bool:
    """Whether it has a run's lock, or nothing yet, or is whole: no other program's folder of such a name."""
    try:
        return _is(path, stat.S_ISDIR) and (
            any(_is(path / name, stat.S_ISREG) for name in (LOCK_NAME, *_WHOLE)) or not any(path.iterdir())
        )
    except OSError:
        return False


def _is_scratch(folder: Path) -> bool:
    return (
        _is(folder / LOCK_NAME, stat.S_ISREG)
        and _is(folder / FILES_NAME, stat.S_ISDIR)
        and folder.stat().st_uid == os.getuid()
    )


def _is_recording(folder: Path) -> bool:
    """Whether `recover` could save a drive from it: not what the same attack or sharing makes again."""
    if (folder / ATTACK_NAME).exists() or (folder / CHECKSUMS_NAME).exists():
        return False
    with suppress(AdvpipeError, OSError), find_partial_recording(folder) as remains:
        return any(True for file in remains.filled_files for _ in Salvage(file).messages())
    return False


def _size_bytes(path: Path) -> int:
    total = 0
    names = [(path.parent, [path.name])] if path.is_file() else ((f, n) for f, _, n in os.walk(path))
    for folder, files in names:
        for name in files:
            with suppress(OSError):  # a living run renames or removes it just now
                status = os.lstat(Path(folder) / name)
                total += status.st_size if stat.S_ISREG(status.st_mode) else 0
    return total
