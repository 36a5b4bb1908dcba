"""The last line of a terminal, which is drawn again and again; everything else is printed above it.

Only light modules of the standard library are imported here, as `signals` imports this one.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO
from unicodedata import east_asian_width

ERASE = "\r\x1b[K"
USUAL_COLUMNS = 80

_lock = threading.RLock()
_terminal: TextIO | None = None
"""Where a line stands."""


def columns(terminal: TextIO) -> int:
    """The width of a terminal in characters."""
    with suppress(OSError, ValueError, AttributeError):
        return os.get_terminal_size(terminal.fileno()).columns or USUAL_COLUMNS
    return USUAL_COLUMNS


def draw(terminal: TextIO, text: str) -> None:
    """Draw the line, in place of the one that stands there; what the terminal has no room for is left out.

    text: escaped.
    """
    global _terminal
    with _lock:
        _write(terminal, f"{ERASE}{fitting(text, columns(terminal) - 1)}")
        _terminal = terminal


def fitting(text: str, most_columns: int) -> str:
    """The beginning of a text that fits; some characters are two columns wide."""
    if text.isascii():
        return text[:most_columns]
    width = 0
    for place, char in enumerate(text):
        width += 2 if east_asian_width(char) in "FW" else 1
        if width > most_columns:
            return text[:place]
    return text


def erase() -> None:
    """Remove the line."""
    global _terminal
    with _lock:
        if _terminal is not None:
            _write(_terminal, ERASE)
        _terminal = None


@contextmanager
def above_status() -> Iterator[None]:
    """Remove the line, and draw none within the block, which prints."""
    with _lock:
        erase()
        yield


def erasing_bytes() -> bytes:
    """What removes the line, for a process that ends at once and cannot wait for whoever draws."""
    return b"" if _terminal is None else ERASE.encode()


def _write(terminal: TextIO, text: str) -> None:
    with suppress(OSError, ValueError):  # closed, or its window is gone
        terminal.write(text)
        terminal.flush()
