"""Atomic output folders: a folder appears under its final name only when it is complete."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError, writing
from advpipe.pipeline.core.lock import (
    HAS_LOCKS,
    LOCK_NAME,
    is_locked,
    one_at_a_time,
    remove_folder,
    take_lock,
    take_stale_lock,
)

REPLACED_NAME = "replaced"
"""The former output within a hidden folder, while the new one takes its name."""

MOVING_NAME = ".moving"
"""Marks a hidden folder whose content is complete and was being moved to its final names."""

_HIDDEN = re.compile(r"\.(.+)\.partial-[^.]+")


def final_path(path: Path) -> Path:
    """The final path of a file that is still in a hidden folder.

    >>> final_path(Path("datasets/.town.partial-x1/clean"))
    PosixPath('datasets/town/clean')
    """
    return Path(*(match[1] if (match := _HIDDEN.fullmatch(part)) else part for part in path.parts))


def leftovers(final: Path) -> list[Path]:
    """The hidden folders of killed and running commands for this output, newest first."""
    if not final.parent.is_dir():
        return []
    found = [
        path for path in final.parent.iterdir() if path.name.startswith(_prefix(final)) and path.is_dir()
    ]
    return sorted(found, key=lambda path: (_changed_ns(path), path.name), reverse=True)


def _changed_ns(path: Path) -> int:
    with suppress(OSError):  # another run has just removed it
        return path.stat().st_mtime_ns
    return 0


@contextmanager
def lock_leftover(leftover: Path) -> Iterator[bool]:
    """Yield whether the run that filled the folder is dead; if so, no other run removes it in the block."""
    lock = take_stale_lock(leftover / LOCK_NAME)
    if lock is None:  # locked by another run, or in a folder that this user cannot write
        yield not is_locked(leftover / LOCK_NAME)
        return
    with lock:
        yield True


def _prefix(final: Path) -> str:
    return f".{final.name}.partial-"


def _make_hidden(final: Path) -> Path:
    folder = Path(tempfile.mkdtemp(prefix=_prefix(final), dir=final.parent))
    folder.chmod(0o755)  # mkdtemp's 0700 would hide the bag from other users
    return folder


def _lock(folder: Path) -> IO[bytes]:
    try:
        lock = take_lock(folder / LOCK_NAME)
        if lock is None:
            raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK), str(folder.parent))
    except OSError:
        remove_folder(folder)
        raise
    return lock


class PartialFolder:
    """A hidden folder beside `final`, which `commit` renames to `final` and `discard` removes.

    A killed run leaves only the hidden folder. It is kept for `advpipe recover` until a later run for the
    same name has finished; of several, only the newest is kept. A folder that a running command still fills
    is recognised by its lock and never touched. The constructor raises OSError if no folder can be made.
    """

    def __init__(self, final: Path) -> None:
        self.final = final
        self._new_parents = [parent for parent in final.parents if not parent.exists()]
        try:
            final.parent.mkdir(parents=True, exist_ok=True)
            with one_at_a_time(final.parent):
                self._remove_leftovers(kept=1)
                self.path = _make_hidden(final)
                self._lock = _lock(self.path)
        except BaseException:  # an interruption, too
            if "path" in vars(self):
                remove_folder(self.path)
            self._remove_new_parents()
            raise

    def commit(self, may_replace: Callable[[Path], bool]) -> None:
        """Give the folder its final name, and replace what has that name if `may_replace` of it is true.

        Raises AdvpipeError if it may not be replaced.
        """
        with one_at_a_time(self.final.parent):
            if self.final.exists() and not may_replace(self.final):
                raise AdvpipeError(f"{self.final} was created in the meantime; not overwriting it")
            (self.path / LOCK_NAME).unlink(missing_ok=True)
            self._lock.close()
            if not self.final.exists():
                self.path.rename(self.final)
                self._remove_leftovers()
                return
            old = _make_hidden(self.final) / REPLACED_NAME
            (old.parent / LOCK_NAME).touch()
            try:
                self.final.rename(old)
                self.path.rename(self.final)
            except BaseException:
                if old.exists() and not self.final.exists():
                    old.rename(self.final)
                raise
            finally:
                remove_folder(old.parent)
            self._remove_leftovers()

    def discard(self, is_finished: bool = False) -> None:
        """Remove the folder, and the folders above it that were made for it and hold nothing else.

        is_finished: its content has been moved to its final place, so leftovers of killed runs go, too.
        """
        if is_finished:
            self._remove_leftovers()
        remove_folder(self.path)
        self._lock.close()
        self._remove_new_parents()

    def _remove_new_parents(self) -> None:
        with suppress(OSError):  # one is not empty, or was never made
            for parent in self._new_parents:
                parent.rmdir()

    def _remove_leftovers(self, kept: int = 0) -> None:
        """Remove the folders of killed runs, except the `kept` newest."""
        if not HAS_LOCKS:
            return
        for leftover in leftovers(self.final):
            with lock_leftover(leftover) as is_dead:
                if is_dead and kept:
                    kept -= 1
                elif is_dead:
                    remove_folder(leftover)


@dataclass(frozen=True)
class FolderKind:
    """The content of a stage's output folder, by which foreign folders are recognised and not replaced.

    name: the type of folder in messages. items: the names that the stage makes. marks: files that every
    finished folder of this type holds.
    """

    name: str
    items: tuple[str, ...]
    marks: tuple[str, ...]

    def refuse_foreign(self, folder: Path) -> None:
        """Raise UsageError if items would be replaced in a folder that is not of this type."""
        taken = [name for name in self.items if (folder / name).exists()]
        lacking = [mark for mark in self.marks if not (folder / mark).is_file()]
        if taken and lacking:
            raise UsageError(
                f"{folder} holds {taken[0]} but no {lacking[0]}, so it is not a {self.name}; it is "
                "not replaced, choose another name"
            )


@contextmanager
def staged_folder(final: Path, overwrite: bool, kind: FolderKind) -> Iterator[Path]:
    """Yield a hidden folder to fill; move its content to `final` when the block ends without an error.

    With `overwrite`, an old `final` is unchanged until then, and those of its items that are not made anew
    are kept: attacks and reports of a data set whose drive is recorded again. Raises OutputExistsError for a
    `final` that exists without `overwrite`, UsageError for one of another type, AdvpipeError for a full disk.
    """

    def refuse() -> None:
        if final.exists() and not overwrite:
            raise OutputExistsError(final)
        if final.exists() and not final.is_dir():
            raise UsageError(f"{final} is not a folder and is not replaced; choose another name")
        kind.refuse_foreign(final)

    finish_moves(final, final)
    refuse()
    partial = PartialFolder(final)
    try:
        with writing(final):
            yield partial.path
        refuse()  # again: another run may have made it in the meantime
        if final.is_dir():
            move_items(partial.path, final)
            partial.discard(is_finished=True)
        else:
            partial.commit(may_replace=lambda _: False)
    except BaseException:
        partial.discard()
        raise


def move_items(new: Path, target: Path, outdated: Sequence[Path] = ()) -> None:
    """Move either all visible items of the hidden folder `new` to the folder `target`, or none.

    outdated: further paths to remove. Replaced items are hidden in `new` and removed with it. A killed run
    leaves only some items moved; `finish_moves` moves the rest. Raises OSError, with every item back in its
    place.
    """
    items = sorted(item for item in new.iterdir() if not item.name.startswith("."))
    places = [(item, target / item.name) for item in items]
    gone = [*outdated, *(path for _, path in places if path.exists())]
    (new / MOVING_NAME).touch()
    try:
        for path in gone:
            path.rename(new / f".old.{path.name}")
        for item, path in places:
            item.rename(path)
    except BaseException:
        for item, path in places:
            if not item.exists():
                path.rename(item)
        for path in gone:
            if (old := new / f".old.{path.name}").exists():
                old.rename(path)
        raise


def finish_moves(
    final: Path, target: Path, outdated: Callable[[Path], Sequence[Path]] = lambda _: ()
) -> None:
    """Finish moving the items of a killed run's output to `target`.

    final: the output path of that run. outdated: further paths to remove, given the run's hidden folder.
    """
    if not HAS_LOCKS or not target.is_dir():
        return
    for leftover in leftovers(final):
        with lock_leftover(leftover) as is_dead:
            if is_dead and (leftover / MOVING_NAME).is_file():
                move_items(leftover, target, outdated(leftover))
                remove_folder(leftover)


def remove_output(path: Path) -> None:
    """Remove a folder if it exists. After a kill it is either complete or gone, never partly removed."""
    if path.exists():
        partial = PartialFolder(path)
        path.rename(partial.path / f".old.{path.name}")
        partial.discard(is_finished=True)
