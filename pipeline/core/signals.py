"""SIGINT, SIGTERM and SIGHUP end a command alike: what it began is cleaned up, and one line says why.

Only light modules of the standard library are imported here: this is loaded before everything else.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

WORDS = {
    getattr(signal, name): word
    for name, word in (("SIGINT", "interrupted"), ("SIGTERM", "terminated"), ("SIGHUP", "hung up"))
    if hasattr(signal, name)  # Windows has no SIGHUP
}
"""The signals that end a command, with what its last line says."""

_AGAIN_S = 0.02
_IMPORT_SYSTEM = ("<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>")
_COMMAND_LINE = ("advpipe.__main__", "advpipe.pipeline.cli", "__main__")

_received: int | None = None
_is_waiting = False


class Stopped(KeyboardInterrupt):
    """A signal asks the command to end: cleaned up after as ctrl-C, of which it is a kind."""

    def __init__(self, number: int) -> None:
        super().__init__(WORDS[number])
        self.number = number


class Deferred:
    """Whether a signal came in the block of `deferred`, and which."""

    def __init__(self) -> None:
        self.number: int | None = None

    def is_set(self) -> bool:
        return self.number is not None

    def raise_if_set(self) -> None:
        if self.number is not None:
            raise Stopped(self.number)


def install() -> None:
    """From now on these signals raise `Stopped` in the main thread; those ignored, as by nohup, stay so."""
    for number in WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _try_again)
    sys.unraisablehook = _unraisable


def uninstall() -> None:
    """The command has ended: one more signal ends the process without a word, whatever it tidies up."""
    global _is_waiting
    _is_waiting = False
    for number in WORDS:
        if signal.getsignal(number) is _stop:
            signal.signal(number, signal.SIG_DFL)


def received() -> int | None:
    """The signal that ends this command, if any: what is raised after it is its consequence."""
    return _received


def last_line(number: int) -> str:
    return f"advpipe: {WORDS[number]}"


def exit_code(number: int) -> int:
    """As shells count it."""
    return 128 + number


def _stop(number: int, frame: FrameType | None) -> None:
    """Raises `Stopped`, but not within an import: libraries catch it there, or are left half loaded.

    Where the command line itself imports, nothing has begun that would have to be cleaned up.
    """
    global _received
    is_first, _received = _received is None, number
    importer = _importer(frame) if is_first and hasattr(signal, "setitimer") else None
    if importer is None:
        raise Stopped(number)
    if importer.startswith(_COMMAND_LINE):
        _end_now(number)
    _wait()


def _wait() -> None:
    global _is_waiting
    _is_waiting = True
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)


def _try_again(_alarm: int, frame: FrameType | None) -> None:
    """The library is loaded, perhaps."""
    global _is_waiting
    if not _is_waiting or _received is None:
        return
    importer = _importer(frame)
    if importer is None:
        _is_waiting = False
        raise Stopped(_received)
    if importer.startswith(_COMMAND_LINE):
        _end_now(_received)
    _wait()


def _importer(frame: FrameType | None) -> str | None:
    """The name of the module whose import statement runs, the outermost one; None outside of imports."""
    found, inner = None, False
    while frame is not None:
        is_import_system = frame.f_code.co_filename in _IMPORT_SYSTEM
        if inner and not is_import_system:
            found = str(frame.f_globals.get("__name__", ""))
        inner, frame = is_import_system, frame.f_back
    return found


def _end_now(number: int) -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    with suppress(OSError):
        os.write(2, f"{last_line(number)}\n".encode())
    os._exit(exit_code(number))


def _unraisable(unraisable: Any) -> None:
    """A signal that arrived in a destructor or callback, which cannot raise, is raised a moment later."""
    if isinstance(unraisable.exc_value, Stopped) and hasattr(signal, "setitimer"):
        _wait()
    else:
        sys.__unraisablehook__(unraisable)


@contextmanager
def deferred() -> Iterator[Deferred]:
    """In the block a first signal is only noted, so that the block can save its state and end by itself."""
    noted = Deferred()
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, _frame: FrameType | None) -> None:
        noted.number = number

    before = {number: signal.getsignal(number) for number in WORDS}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, note)
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def blocked() -> Iterator[None]:
    """Signals wait until the end of the block; a process that is started within begins with them blocked."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, WORDS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def leave_to_parent() -> None:
    """In a worker process, started within `blocked`: signals are the parent's business alone."""
    for number in WORDS:
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, WORDS)
