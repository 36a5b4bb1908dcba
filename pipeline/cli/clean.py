"""The command that shows what killed runs left, and removes it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from advpipe.pipeline.cli.shared import Answer, print_line, typed
from advpipe.pipeline.core.progress import with_progress

if TYPE_CHECKING:
    from advpipe.pipeline.dataset.leftovers import Leftover

DATASETS = Path("datasets")


@with_progress("looking for what killed runs left", at_once=False)
def clean(
    path: Annotated[
        Path | None,
        typer.Argument(
            help="Folder to look below, or one leftover.",
            show_default="the current folder, datasets, and temporary files",
        ),
    ] = None,
    remove: Annotated[
        bool,
        typer.Option("--remove", help="Remove what nothing can use, and PATH if it is a leftover."),
    ] = False,
    everything: Annotated[
        bool,
        typer.Option("--all", help="With --remove, also what a run could go on from or `recover` save."),
    ] = False,
) -> Answer:
    """Show what killed runs left: hidden folders and files of advpipe, and what could still use them.

    Only lists without --remove. What a living run holds stays, and so does everything that is not advpipe's.
    """
    from advpipe.pipeline.core.errors import UsageError, one_line, os_error_line
    from advpipe.pipeline.core.verbosity import notice, print_result

    if everything and not remove:
        raise UsageError("--all needs --remove; without both, everything is listed")
    tally, is_refused = _LeftoverTally(), False
    records: list[dict[str, Any]] = []
    for leftover in _found(path):
        use, is_removed = None if leftover.is_running else leftover.use, False
        record = _record(leftover, use)  # what is in it is read before it goes
        about = _about(leftover, use)
        if remove and (use is None or everything or leftover.path == path):
            try:
                is_removed = leftover.remove()
            except OSError as error:
                is_refused = True
                notice(f"advpipe: {os_error_line(error)}")
        tally.add(leftover, use, is_removed)
        records.append({**record, "removed": is_removed})
        what = "removed " if is_removed else ""
        print_result(f"{what}{one_line(leftover.path)}  {_size(leftover.size_bytes)}  {one_line(about)}")
    removal = [typed("clean", *([path] if path else []), "--remove")]
    return Answer(
        {"leftovers": records},
        print_line(tally.text(remove)),
        exit_code=int(is_refused),
        next_commands=removal if tally.useless and not remove else (),
    )


@dataclass
class _LeftoverTally:
    """How many there are, and their bytes: all, those removed, and those that nothing can use."""

    count: int = 0
    bytes: int = 0
    removed: int = 0
    removed_bytes: int = 0
    useless: int = 0
    useful: int = 0

    def add(self, leftover: Leftover, use: str | None, is_removed: bool) -> None:
        self.count += 1
        self.bytes += leftover.size_bytes
        self.removed += is_removed
        self.removed_bytes += leftover.size_bytes * is_removed
        self.useful += use is not None and not is_removed
        self.useless += use is None and not leftover.is_running and not is_removed

    def text(self, remove: bool) -> str:
        """The last line of the list."""
        if not self.count:
            return "no leftovers of killed runs"
        if remove:
            text = f"{self.removed} of {self.count} removed, {_size(self.removed_bytes)}"
            return f"{text}; {self.useful} kept, which --all would also remove" if self.useful else text
        text = f"{self.count} in all, {_size(self.bytes)}"
        if self.useless:
            text += f"; --remove deletes {self.useless} that nothing can use"
        return (
            f"{text}; --remove --all also deletes {self.useful} that can still be used"
            if self.useful
            else text
        )


def _found(path: Path | None) -> Iterator[Leftover]:
    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.dataset.leftovers import find_leftovers, find_scratch, recognise, refuse_inside
    from advpipe.pipeline.process.folder import working_path

    if path is None:
        yield from find_leftovers(working_path("."))
        if DATASETS.is_symlink() and DATASETS.is_dir():  # links are not followed, but for this one
            yield from find_leftovers(DATASETS)
        yield from find_scratch()
        return
    if recognise(path) is None and not path.is_dir():
        what = "is not a folder" if path.exists() or path.is_symlink() else "does not exist"
        raise UsageError(f"{path} {what}; give a folder to look below")
    refuse_inside(path)
    yield from find_leftovers(path)


def _record(leftover: Leftover, use: str | None) -> dict[str, Any]:
    return {
        "path": str(leftover.path),
        "kind": leftover.kind,
        "belongs_to": None if leftover.kind == "scratch" else str(leftover.final),
        "bytes": leftover.size_bytes,
        "frames": leftover.frames if leftover.kind == "job" else None,
        "running": leftover.is_running,
        "use": use,
    }


def _about(leftover: Leftover, use: str | None) -> str:
    """What it belongs to, and what can be done with it."""
    final, frames = leftover.final, leftover.frames if leftover.kind == "job" else 0
    if leftover.is_running:
        return (
            "temporary files of a running command"
            if leftover.kind == "scratch"
            else f"{final}, still being written"
        )
    if use == "recover":
        return f"incomplete recording {final}: `advpipe recover {shlex.quote(str(leftover.path))}` saves it"
    if use == "restore":
        return (
            f"the previous {final}, which a killed run was replacing: it is in {leftover.path / 'replaced'}"
        )
    if use == "resume":
        done = f"{frames} finished frames of {final}" if frames else f"{final}, complete but not yet renamed"
        return f"{done}: running the same command again resumes there"
    if leftover.kind == "scratch":
        return "temporary files: no longer of use"
    return f"{'frames' if leftover.kind == 'job' else 'part'} of {final}: no longer of use"


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:,.1f} MB" if size_bytes >= 100_000 else f"{size_bytes / 1e3:.1f} kB"
