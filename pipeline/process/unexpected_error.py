"""Unexpected errors: one line that asks the user to report the bug, and a file with the traceback."""

from __future__ import annotations

import os
import sys

from advpipe.pipeline.core.text import one_line

SHOW = "ADVPIPE_TRACEBACK"
"""Environment variable that shows the traceback, too, as --traceback does."""

FOLDER = "ADVPIPE_TRACEBACK_DIR"
"""Environment variable: the folder for these files, instead of the folder for temporary files."""


def report_unexpected(error: BaseException) -> str:
    """Write the traceback to a file and return the line.

    The traceback is also printed if `SHOW` is set, or if the file cannot be written.
    """
    import traceback

    text = "".join(traceback.format_exception(error))
    what = one_line(f"unexpected {traceback.format_exception_only(error)[-1]}", 300)
    try:
        request = f"please report it, with {_write_report(text)}"
        is_shown = os.environ.get(SHOW, "0") not in ("", "0")
    except OSError as refusal:
        request = (
            f"please report it, with the traceback above, which cannot be saved to a file: {refusal.strerror}"
        )
        is_shown = True
    if is_shown:
        print(text, end="", file=sys.stderr)
    return f"{what}; this is a bug in advpipe: {request}"


def _write_report(text: str) -> str:
    """Write a traceback, versions and the command to a new file, and return its name."""
    import platform
    import shlex
    import tempfile
    from datetime import datetime, timezone

    from advpipe.pipeline.core.versions import installed

    about = {
        "advpipe": installed("advpipe"),
        "Python": f"{platform.python_version()} ({platform.python_implementation()})",
        "platform": platform.platform(),
        "command": shlex.join(sys.argv),
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
    head = "".join(f"{key}: {value}\n" for key, value in about.items())
    number, path = tempfile.mkstemp(".txt", "advpipe-error-", os.environ.get(FOLDER) or None)
    with open(number, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.write(f"{head}\n{text}")
    return path
