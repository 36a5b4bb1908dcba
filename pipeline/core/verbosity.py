"""Decides how much a command prints besides its result, and where.

A result goes to standard output: text for people, or with --json one document for programs. Everything else
goes to standard error: notices (unless --quiet), and with --verbose details such as loaded files, seeds,
versions and the duration of each phase. Worker processes print nothing.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple, TextIO

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.status_line import above_status
from advpipe.pipeline.core.text import one_line


@dataclass(frozen=True)
class Verbosity:
    """The user's choice of output.

    quiet: only errors. verbose: details, too. as_json: standard output holds only the JSON document. Raises
    UsageError if both quiet and verbose are set.
    """

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise UsageError("--quiet and --verbose contradict each other; leave one of them out")


class WorkerLine(NamedTuple):
    """What another process would have printed: a notice, or a detail of --verbose."""

    text: str
    is_detail: bool = False


_current = Verbosity()
_collected: list[WorkerLine] | None = None
_begin_s = time.monotonic()


def is_quiet() -> bool:
    """Whether the command prints only errors."""
    return _current.quiet


def is_for_people() -> bool:
    """Whether standard output is to hold text for people."""
    return not (_current.quiet or _current.as_json)


def print_result(text: object) -> None:
    """Print a part of the result that is known before the rest, such as a cell of a sweep."""
    if not _current.quiet and _collected is None:
        with above_status():
            print(text, file=sys.stderr if _current.as_json else sys.stdout, flush=True)


def notice(text: object) -> None:
    """Print one line that the user should read although it is not an error."""
    if _collected is not None:
        _collected.append(WorkerLine(one_line(text)))
    elif not _current.quiet:
        with above_status():
            # In one piece: a signal may come after any other write, and its line must not continue this one.
            print(f"{one_line(text)}\n", end="", file=sys.stderr, flush=True)


def detail(text: object) -> None:
    """Print one line that only --verbose shows, with the seconds since the command began."""
    if not _current.verbose:
        return
    if _collected is not None:
        _collected.append(WorkerLine(one_line(text), is_detail=True))
    else:
        with above_status():
            print(f"[{time.monotonic() - _begin_s:6.1f} s] {one_line(text)}", file=sys.stderr, flush=True)


@contextmanager
def collected(verbose: bool) -> Iterator[list[WorkerLine]]:
    """Keep what the block would print, for the process that a worker works for. verbose: details, too."""
    global _collected
    before, _collected = _collected, []
    try:
        with use_verbosity(Verbosity(verbose=verbose)):
            yield _collected
    finally:
        _collected = before


def is_verbose() -> bool:
    """Whether the command prints details."""
    return _current.verbose


@contextmanager
def phase(name: str) -> Iterator[None]:
    """Print, with --verbose, how long the block took."""
    begin_s = time.monotonic()
    yield
    detail(f"{name}: {time.monotonic() - begin_s:.2f} s")


@contextmanager
def use_verbosity(verbosity: Verbosity) -> Iterator[None]:
    """Apply a verbosity within the block. Warnings of libraries are treated as details."""
    global _current, _begin_s
    before, _current, _begin_s = (_current, _begin_s), verbosity, time.monotonic()
    try:
        with warnings.catch_warnings():
            silence_warnings()
            yield
    finally:
        _current, _begin_s = before


def silence_warnings() -> None:
    """Treat warnings of libraries as details, unless Python's -W option configures them."""
    if sys.warnoptions:
        return
    if _current.verbose:
        warnings.simplefilter("default")
        warnings.showwarning = _show_warning
    else:
        warnings.simplefilter("ignore")


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    detail(f"{category.__name__}: {message} ({filename}, line {lineno})")
