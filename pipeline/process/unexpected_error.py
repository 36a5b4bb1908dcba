"""An error that nobody thought of: one line that asks to report it, and a file with what a report needs."""

from __future__ import annotations

import os
import sys

from advpipe.pipeline.core.text import one_line

SHOW = "ADVPIPE_TRACEBACK"
"""Environment variable: the traceback is shown, too, as with --traceback."""

FOLDER = "ADVPIPE_TRACEBACK_DIR"
"""Environment variable: the folder of such files, instead of the one for temporary files."""


def report_unexpected(error: BaseException) -> str:
    """Writes the file; returns the line. The traceback is shown where asked for, or not to be written."""
    import traceback

    text = "".join(traceback.format_exception(error))
    what = one_line(f"unexpected {traceback.format_exception_only(error)[-1]}", 300)
    try:
        request = f"please report it, with {_written(text)}"
        is_shown = os.environ.get(SHOW, "0") not in ("", "0")
    except OSError as refusal:
        request = (
            f"please report it, with the traceback above, which cannot be saved to a file: {refusal.strerror}"
        )
        is_shown = True
    if is_shown:
        print(text, end="", file=sys.stderr)
    return f"{what}; this is a bug in advpipe: {request}"


def _written(text: str) -> str:
    """The name of a new file that holds a traceback and where it comes from."""
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
