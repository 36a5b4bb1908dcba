"""Handles SIGINT, SIGTERM and SIGHUP alike: the command cleans up, prints one line with the reason and ends.

Only light modules of the standard library are imported, as this module is loaded before all others.
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

from advpipe.pipeline.core.status_line import erasing_bytes

REASONS = {
    getattr(signal, name): reason
    for name, reason in (("SIGINT", "interrupted"), ("SIGTERM", "terminated"), ("SIGHUP", "hung up"))
    if hasattr(signal, name)  # Windows has no SIGHUP
}
"""The signals that end a command, with the reason in its last line."""

_RETRY_S = 0.02
_IMPORT_SYSTEM = ("<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>")
_COMMAND_LINE = ("advpipe.__main__", "advpipe.pipeline.cli", "__main__")

_received: int | None = None
_is_waiting = _is_blocked = False


class Stopped(KeyboardInterrupt):
    """A signal ended the command. It is a KeyboardInterrupt, so that the cleanup is that of Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(REASONS[number])
        self.number = number


class Deferred:
    """The signal, if any, that arrived in the block of `deferred`."""

    def __init__(self) -> None:
        self.number: int | None = None

    def is_set(self) -> bool:
        """Whether a signal arrived."""
        return self.number is not None

    def raise_if_set(self) -> None:
        """Raise `Stopped` if a signal arrived."""
        if self.number is not None:
            raise Stopped(self.number)


def install() -> None:
    """Make these signals raise `Stopped` in the main thread; ignored signals (as with nohup) stay ignored."""
    for number in REASONS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _retry)
    sys.unraisablehook = _unraisable


def uninstall() -> None:
    """Restore the default handlers after the command's end: a further signal ends the process silently."""
    global _is_waiting
    _is_waiting = False
    for number in REASONS:
        if signal.getsignal(number) is _stop:
            signal.signal(number, signal.SIG_DFL)


def received() -> int | None:
    """The signal that ends this command, or None: an exception after it is its consequence."""
    return _received


def last_line(number: int) -> str:
    """The line that a command prints when this signal ends it."""
    return f"advpipe: {REASONS[number]}"


def exit_code(number: int) -> int:
    """The exit code of a command that this signal ends, by the convention of shells."""
    return 128 + number


def _stop(number: int, frame: FrameType | None) -> None:
    """Raise `Stopped`, except during an import, where libraries catch it or are left half loaded.

    While the command line itself imports, nothing has begun that needs cleaning up, so the process ends.
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
    signal.setitimer(signal.ITIMER_REAL, _RETRY_S)


def _retry(_alarm: int, frame: FrameType | None) -> None:
    """Raise `Stopped` if the import, or a block of `blocked`, has ended in the meantime."""
    global _is_waiting
    if not _is_waiting or _received is None:
        return
    if _is_blocked:
        _wait()
        return
    importer = _importer(frame)
    if importer is None:
        _is_waiting = False
        raise Stopped(_received)
    if importer.startswith(_COMMAND_LINE):
        _end_now(_received)
    _wait()


def _importer(frame: FrameType | None) -> str | None:
    """The name of the module whose import statement runs, the outermost if nested; None outside imports."""
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
        os.write(2, erasing_bytes() + f"{last_line(number)}\n".encode())
    os._exit(exit_code(number))


def _unraisable(unraisable: Any) -> None:
    """Raise `Stopped` a moment later if a signal arrived in a destructor or callback, which cannot raise."""
    if isinstance(unraisable.exc_value, Stopped) and hasattr(signal, "setitimer"):
        _wait()
    else:
        sys.__unraisablehook__(unraisable)


@contextmanager
def deferred() -> Iterator[Deferred]:
    """Only note a signal that arrives in the block, so that the block can save its state and then end."""
    noted = Deferred()
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, _frame: FrameType | None) -> None:
        noted.number = number

    before = {number: signal.getsignal(number) for number in REASONS}
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
    """Block the signals until the end of the block, after which they are handled; a process that is started
    in it inherits the mask.

    The mask is that of this thread. Where another thread takes a signal, its handler would run here all the
    same, in the middle of the block: therefore it is deferred as well. So is one that came during an import.
    """
    global _is_blocked
    noted, was_blocked = Deferred(), _is_blocked
    _is_blocked = True
    try:
        with deferred() as noted:
            if not hasattr(signal, "pthread_sigmask"):
                yield
                return
            before = signal.pthread_sigmask(signal.SIG_BLOCK, REASONS)
            try:
                yield
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
    finally:
        _is_blocked = was_blocked
        if noted.number is not None:
            signal.raise_signal(noted.number)


def leave_to_parent() -> None:
    """Ignore the signals in a worker process that was started within `blocked`: its parent handles them."""
    for number in REASONS:
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, REASONS)
