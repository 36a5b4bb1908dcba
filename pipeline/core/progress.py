"""Progress of a command on standard error: a bar on a terminal, a line every ten seconds elsewhere.

A command shows one bar over all of its phases. It, or the first function of the API that is called, opens the
display; what it calls plans the phases and goes through them: `plan_progress`, `working_on`, `track`. Nothing
heavy is imported here: the first word stands there before libraries are loaded.
"""

from __future__ import annotations

import inspect
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager, suppress
from functools import wraps
from typing import Any, ParamSpec, TextIO, TypeVar

from advpipe.pipeline.core import signals, status_line
from advpipe.pipeline.core.phases import Phase
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.core.streams import unwrapped
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.core.verbosity import detail, is_quiet, notice

T = TypeVar("T")
P = ParamSpec("P")

LINE_EVERY_S = 10.0
"""Interval of the lines in a pipe or a log file."""

FIRST_WORD_S = 0.8
"""When work that is usually done at once says what it is, if it is not done."""

DRAW_EVERY_S = 0.2

MOST_SHOWN = 0.99
"""How far a command that has not ended is at most."""

LEFT_FROM = 0.02
"""How much must be done for the first estimate of the time that is left."""

NEWEST = "the newest data set"
"""What an option that names no bag stands for."""


def with_progress(words: str, at_once: bool = True) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Show the progress of a function: a command, or one of the API.

    words: what it is doing, with names of its parameters in braces. at_once: it loads libraries or works for
    seconds, so its first word comes before all else; otherwise only if it takes long.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def shown(*args: P.args, **options: P.kwargs) -> T:
            try:
                bound = inspect.signature(function).bind(*args, **options)
            except TypeError:
                return function(*args, **options)  # raises what Python says of such a call
            bound.apply_defaults()
            with open_progress(_filled_in(words, bound.arguments), at_once):
                return function(*args, **options)

        return shown

    return decorate


@contextmanager
def open_progress(title: str, at_once: bool = True) -> Iterator[None]:
    """Show the progress of the block; within a command that shows its own, of which this is a part, do
    nothing."""
    global _display
    if _display is not None or is_quiet():
        yield
        return
    _display = _Display(one_line(title), at_once)
    try:
        yield
    finally:
        end_progress()


def end_progress() -> None:
    """Show nothing more of what goes on: the command waits for its user, as a server does, or has ended."""
    global _display
    ended, _display = _display, None
    if ended is not None:
        ended.close()


def plan_progress(shares: Mapping[str, float]) -> None:
    """Expect these phases of the work that goes on, in this order; shares: of its time, in any unit."""
    if (display := _own_display()) is not None:
        display.plan({one_line(name): share for name, share in shares.items()})


@contextmanager
def working_on(name: str) -> Iterator[Phase]:
    """Show the block as a phase of the work; with --verbose, print how long it took."""
    name, begin_s = one_line(name), time.monotonic()
    with _in_phase(name) as phase:
        yield phase
    detail(f"{name}: {time.monotonic() - begin_s:.2f} s")


def track(
    items: Iterable[T], description: str, total: int | None = None, status: Callable[[], str] | None = None
) -> Iterator[T]:
    """Yield the same items, and show them as a phase of the work: how many are done, and what is left.

    total: number of items, if they have no length. status: returns a text to show beside their number.
    """
    description, begin_s = one_line(description), time.monotonic()
    total = len(items) if total is None and isinstance(items, Sized) else total
    with _in_phase(description, total, status) as phase:
        for item in items:
            yield item
            phase.advance()
    detail(f"{description}: {phase.count:,} in {time.monotonic() - begin_s:.2f} s")


@contextmanager
def _in_phase(
    name: str, total: int | None = None, status: Callable[[], str] | None = None
) -> Iterator[Phase]:
    """A phase of what is shown; outside of all commands, a display of its own."""
    with open_progress("", at_once=False):
        display = _own_display()
        if display is None:
            yield Phase(name, total=total)
            return
        outer = display.phases[-1]
        if not outer.name:
            display.plan({name: 1.0})
        phase = outer.part(name, total, status)
        display.phases.append(phase)
        try:
            yield phase
            outer.leave(phase)
        finally:
            if phase in display.phases:
                del display.phases[display.phases.index(phase) :]


class _Display:
    """What a thread shows of the phases of a command, until it is closed."""

    def __init__(self, title: str, at_once: bool) -> None:
        self.phases = [Phase(title)]
        self.owner = threading.get_ident()
        self._terminal = _terminal()
        self._begin_s, self._begin_done, self._is_planned = time.monotonic(), 0.0, False
        is_command = bool(title) or self._terminal is not None
        later_s = FIRST_WORD_S if is_command else LINE_EVERY_S
        self._due_s = self._begin_s + (0.0 if at_once else later_s)
        self._closed = threading.Event()
        if at_once:
            self.show()
        self._thread = threading.Thread(target=self._run, name="progress", daemon=True)
        with signals.blocked():  # which the thread inherits: signals are for the main thread, which may block
            self._thread.start()

    def plan(self, shares: Mapping[str, float]) -> None:
        """Expect these phases of the one that goes on. The command's own begin now: what came before, such as
        the loading of libraries, says nothing of how long they take."""
        self.phases[-1].plan(shares)
        if len(self.phases) == 1:
            self._begin_s, self._begin_done, self._is_planned = time.monotonic(), self._done(), True

    def close(self) -> None:
        """Show nothing any more."""
        self._closed.set()
        try:
            self._thread.join(timeout=1.0)  # unless it waits for a terminal that was stopped
        finally:
            if self._terminal is not None:
                status_line.erase()

    def show(self) -> None:
        """Draw the bar, or print a line; the first one is what is done, without figures."""
        if self._terminal is not None:
            status_line.draw(self._terminal, self.bar(status_line.columns(self._terminal)))
            self._due_s = time.monotonic() + DRAW_EVERY_S
        else:
            if line := self.line():
                notice(line)
            self._due_s = time.monotonic() + LINE_EVERY_S

    def line(self) -> str:
        """Such as `evaluating drive: detecting: 12 of 40, about 20 s left`."""
        phases = tuple(self.phases)
        left, status = self._left(), phases[-1].status
        whole = ": ".join(_texts_of(phases)) + (f", about {left} left" if left else "")
        if whole and len(phases) == 1 and not left:
            whole += " ..."
        return f"{whole}; {one_line(status())}" if status else whole

    def bar(self, columns: int) -> str:
        """The same with a bar before it, for one line of a terminal; without room, outer phases go."""
        phases, done = tuple(self.phases), self._done()
        has_blocks = "utf" in (getattr(self._terminal, "encoding", None) or "").lower()
        full, empty = ("█", "░") if has_blocks else ("#", ".")
        cells = max(min(24, columns // 4), 1)
        filled = int(cells * done)
        left, status = self._left(), phases[-1].status
        done_text = f"{full * filled}{empty * (cells - filled)} {100 * done:3.0f} %"
        head = f"{done_text}  {f'{left} left' if left else '':<11}  "
        texts = _texts_of(phases)
        if status:
            texts[-1] += f"; {one_line(status())}"
        while len(texts) > 1 and len(head) + len(": ".join(texts)) >= columns:
            del texts[0]
        return head + ": ".join(texts)

    def _done(self) -> float:
        """How far the command is; it is never all done while it is shown."""
        return min(self.phases[-1].done, MOST_SHOWN)

    def _left(self) -> str:
        """An estimate of the time that is left, such as `20 s`; empty where too little is known for one.

        It comes of what was done when something was done last, and falls from then on; what takes longer than
        that has none.
        """
        phases, done = tuple(self.phases), self._done()
        gained = done - self._begin_done
        if not self._is_planned or gained < LEFT_FROM or any(one.total and not one.count for one in phases):
            return ""
        moved_s = phases[-1].moved_s
        left_s = (moved_s - self._begin_s) / gained * (1 - done) - (time.monotonic() - moved_s)
        return duration_text(left_s) if left_s > 0 else ""

    def _run(self) -> None:
        while not self._closed.wait(max(self._due_s - time.monotonic(), 0.01)):
            if time.monotonic() >= self._due_s:
                with suppress(OSError, ValueError):  # standard error is closed
                    self.show()


def _texts_of(phases: Sequence[Phase]) -> list[str]:
    """From the command to what is going on; work outside of a command has no title."""
    return [phase.text(phase is phases[-1]) for phase in phases if phase.name]


def duration_text(duration_s: float) -> str:
    """About how long, such as `20 s`, `3 min` or `2 h`."""
    for limit_s, unit_s, unit in ((90, 1, "s"), (90 * 60, 60, "min")):
        if duration_s < limit_s:
            return f"{duration_s / unit_s:.0f} {unit}"
    return f"{duration_s / 3600:.0f} h"


_display: _Display | None = None


def _own_display() -> _Display | None:
    """What is shown of this thread's work; another thread's phases are not those of the command."""
    return _display if _display is not None and _display.owner == threading.get_ident() else None


def _terminal() -> TextIO | None:
    """The terminal that standard error is, if a line can be drawn again on it."""
    stream = unwrapped(sys.stderr)
    if stream is None or stream.closed or not stream.isatty() or os.environ.get("TERM") == "dumb":
        return None
    understands_escapes = sys.platform != "win32" or "WT_SESSION" in os.environ  # the Windows Terminal
    return stream if understands_escapes else None


def _filled_in(words: str, arguments: Mapping[str, Any]) -> str:
    """The words with the arguments that they name."""
    named = {name: value for name, value in arguments.items() if f"{{{name}}}" in words}
    return words.format_map({name: shorten(_text(value)) for name, value in named.items()})


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        if not value:
            return NEWEST
        first, *others = map(_text, value)
        return f"{first} and {len(others)} more" if others else first
    if value is None:
        return NEWEST
    if isinstance(value, os.PathLike):
        return str(os.fspath(value))
    return str(getattr(value, "name", value))
