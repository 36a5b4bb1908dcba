"""Standard output and error that show whatever text they are given, and obey none of it.

Names of topics, folders and frames, and the record of who made a bag, are text from others: an escape
sequence in it could clear the screen, retitle the window or hide a line. Whatever a command prints goes
through `safe_streams`, so no command has to think of it.
"""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.text import escape_unprintable

if TYPE_CHECKING:
    from rich.console import Console


def unwrapped(stream: TextIO) -> TextIO:
    """The stream itself, for a bar that moves the cursor; its text has to be spelt out before."""
    return stream._stream if isinstance(stream, SafeStream) else stream


class SafeStream:
    """A text stream that writes `escape_unprintable` text to another one.

    It is no terminal to libraries that ask, so that they send no colours: those would be spelt out, too.
    is_optional: what cannot be written is dropped, as messages on a closed standard error are.
    """

    def __init__(self, stream: TextIO, is_optional: bool) -> None:
        self._stream, self._is_optional = stream, is_optional

    def write(self, text: str) -> int:
        with self._refusals_told():
            self._stream.write(escape_unprintable(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        with self._refusals_told():
            self._stream.flush()

    def isatty(self) -> bool:
        return False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextmanager
    def _refusals_told(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            if not self._is_optional:
                raise
        except OSError as error:
            if not self._is_optional:
                drop_output()
                raise AdvpipeError(f"standard output cannot be written: {error.strerror}") from None


@contextmanager
def safe_streams() -> Iterator[None]:
    """Within the block, standard output and error spell out what must not reach a terminal.

    A character that the locale's encoding lacks is shown as `?`.
    """
    before = sys.stdout, sys.stderr
    errors = [getattr(stream, "errors", None) for stream in before]
    for stream in before:
        _reconfigure(stream, "replace")
    sys.stdout = cast(TextIO, SafeStream(before[0], is_optional=False))
    sys.stderr = cast(TextIO, SafeStream(before[1], is_optional=True))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
        for stream, error in zip(before, errors, strict=True):
            if error is not None:
                _reconfigure(stream, error)


def _reconfigure(stream: Any, errors: str) -> None:
    with suppress(AttributeError, OSError, ValueError):  # it flushes, and may be full, closed or no file
        stream.reconfigure(errors=errors)


def plain_console() -> Console:
    """For tables on standard output: text is shown as it is, without rich's markup and emoji codes."""
    from rich.console import Console

    return Console(markup=False, emoji=False, highlight=False)


def open_closed() -> None:
    """Opens standard streams that were closed on entry, on nothing.

    Otherwise the next file to be opened would get their numbers, and what a library writes to standard output
    would land in it.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def drop_output() -> None:
    """What standard output still holds back cannot be written: it goes nowhere, rather than fail again."""
    with suppress(OSError, ValueError):  # no file, as in a test
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        sys.stdout.flush()


def flush_output() -> None:
    """Writes what is held back; raises AdvpipeError where that is refused, but for a reader that is gone."""
    SafeStream(sys.stdout, is_optional=False).flush()


def is_reader_gone() -> bool:
    """Whether the reader of standard output is gone, as after `| head`."""
    with suppress(OSError, ValueError, AttributeError):
        poll = select.poll()
        poll.register(sys.stdout.fileno(), 0)  # errors alone are reported
        return bool(poll.poll(0))
    return False
