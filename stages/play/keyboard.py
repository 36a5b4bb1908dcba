"""Keys that a user presses while a bag is played, where standard input is a terminal."""

from __future__ import annotations

import os
import select
import sys
import time
from types import TracebackType
from typing import Any

PAUSE, QUIT = " ", "q"


class Keyboard:
    """Within the block, keys come without Enter and are not shown; afterwards the terminal is as before.

    Where standard input is no terminal, or the command runs in the background, no key ever comes.
    """

    def __init__(self) -> None:
        self._file: int | None = None
        self._before: list[Any] = []

    def __enter__(self) -> Keyboard:
        if _is_ours():
            import termios
            import tty

            self._file = sys.stdin.fileno()
            self._before = termios.tcgetattr(self._file)
            tty.setcbreak(self._file)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            import termios

            termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    @property
    def is_there(self) -> bool:
        """Whether keys can come."""
        return self._file is not None

    def wait(self, timeout_s: float) -> str:
        """The key that is pressed within this time; "" for none."""
        if self._file is None:
            time.sleep(max(timeout_s, 0.0))
            return ""
        ready, _, _ = select.select([self._file], [], [], max(timeout_s, 0.0))
        if not ready:
            return ""
        key = os.read(self._file, 1).decode(errors="replace")
        if not key:  # the terminal is gone
            self._file = None
        return key


def _is_ours() -> bool:
    if sys.stdin is None or sys.stdin.closed or not sys.stdin.isatty() or sys.platform == "win32":
        return False
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # a terminal, but not the one that controls this process
        return False
