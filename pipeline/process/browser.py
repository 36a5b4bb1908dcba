"""A page in the user's browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path


def open_page(page: Path) -> bool:
    """Shows a file in the browser; False where there is no screen, or no browser.

    A browser in the terminal is never started: it would take the terminal away from the command.
    """
    has_screen = sys.platform in ("win32", "darwin") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    try:
        return has_screen and webbrowser.open(page.resolve().as_uri())
    except (webbrowser.Error, OSError):
        return False
