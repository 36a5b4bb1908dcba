"""Progress of long work on standard error: a bar on a terminal, a line every few seconds elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from typing import TextIO, TypeVar

from advpipe.pipeline.core.streams import unwrapped
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.core.verbosity import detail, is_quiet, notice

T = TypeVar("T")

LINE_EVERY_S = 10.0
"""Interval of the lines in a pipe or a log file; work that takes less time prints none."""


def track(
    items: Iterable[T], description: str, total: int | None = None, status: Callable[[], str] | None = None
) -> Iterator[T]:
    """Yield the same items, and show on standard error how many are done and how long the rest will take.

    total: number of items, if they have no length. status: returns a text to show, called for each item.
    --quiet suppresses the output.
    """
    description, begin_s, count = one_line(description), time.monotonic(), 0
    total = len(items) if total is None and isinstance(items, Sized) else total
    for count, item in enumerate(_with_progress(items, description, total, status), 1):  # noqa: B007
        yield item
    detail(f"{description}: {count:,} in {time.monotonic() - begin_s:.2f} s")


def _with_progress(
    items: Iterable[T], description: str, total: int | None, status: Callable[[], str] | None
) -> Iterable[T]:
    if is_quiet():
        return items
    terminal = unwrapped(sys.stderr)
    if terminal is not None and not terminal.closed and terminal.isatty():
        return _with_bar(items, terminal, description, total, status)
    return _with_lines(items, description, total, status)


def _with_bar(
    items: Iterable[T],
    terminal: TextIO,
    description: str,
    total: int | None,
    status: Callable[[], str] | None,
) -> Iterator[T]:
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(file=terminal), redirect_stdout=False) as progress:
        task = progress.add_task(escape(description), total=total)
        for item in items:
            yield item
            beside = f": {one_line(status())}" if status else ""
            progress.update(task, advance=1, description=escape(f"{description}{beside}"))


def _with_lines(
    items: Iterable[T], description: str, total: int | None, status: Callable[[], str] | None
) -> Iterator[T]:
    begin_s = last_s = time.monotonic()
    for count, item in enumerate(items, 1):
        yield item
        now_s = time.monotonic()
        if now_s - last_s < LINE_EVERY_S:
            continue
        last_s = now_s
        done = f"{count:,}"
        if total:
            left_s = (now_s - begin_s) / count * (total - count)
            done = f"{count:,} of {total:,}, about {left_s:.0f} s left"
        notice(f"{description}: {done}{f'; {status()}' if status else ''}")
