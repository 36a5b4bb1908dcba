"""Standard output and error that escape control sequences in untrusted text.

Names of topics, folders and frames, and the provenance of a bag, are untrusted text: an escape sequence in it
could clear the screen, retitle the window or hide a line. Everything that a command prints goes through
`safe_streams`, so that no command needs to escape text itself.
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
    """The original stream, for a progress bar that moves the cursor; the caller escapes its text."""
    return stream._stream if isinstance(stream, SafeStream) else stream


class SafeStream:
    """A text stream that writes text through `escape_unprintable` to another stream.

    `isatty` is False so that libraries send no colours, which would be escaped, too.
    is_optional: text that cannot be written is dropped, such as messages on a closed standard error.
    """

    def __init__(self, stream: TextIO, is_optional: bool) -> None:
        self._stream, self._is_optional = stream, is_optional

    def write(self, text: str) -> int:
        """Write the escaped text. Raises AdvpipeError if it cannot be written and the stream is required."""
        with self._write_errors():
            self._stream.write(escape_unprintable(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Flush the stream. Raises as `write` does."""
        with self._write_errors():
            self._stream.flush()

    def isatty(self) -> bool:
        return False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextmanager
    def _write_errors(self) -> Iterator[None]:
        """Raise AdvpipeError for output that cannot be written, or drop it if the stream is optional."""
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
    """Make standard output and error escape unsafe text within the block.

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
    with suppress(AttributeError, OSError, ValueError):  # flushes a stream that may be full or closed
        stream.reconfigure(errors=errors)


def plain_console() -> Console:
    """A console for tables on standard output; it shows text literally, without rich's markup and emoji."""
    from rich.console import Console

    return Console(markup=False, emoji=False, highlight=False)


def open_closed() -> None:
    """Open standard streams that were closed at the start of the program, on the null device.

    Otherwise the next file to be opened would get such a stream's descriptor, and a library that writes
    to standard output would write into that file.
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
    """Discard buffered standard output that cannot be written, so that it does not fail again at exit."""
    with suppress(OSError, ValueError):  # not a file, as in a test
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        sys.stdout.flush()


def flush_output() -> None:
    """Write buffered standard output.

    Raises BrokenPipeError if its reader has ended, and AdvpipeError if it cannot be written otherwise.
    """
    SafeStream(sys.stdout, is_optional=False).flush()


def is_reader_gone() -> bool:
    """Whether the reader of standard output has ended, as after `| head`."""
    with suppress(OSError, ValueError, AttributeError):
        poll = select.poll()
        poll.register(sys.stdout.fileno(), 0)  # only errors are reported
        return bool(poll.poll(0))
    return False
