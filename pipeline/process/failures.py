"""Reports the failure of a command: one line and an exit code.

Exit codes: 0: success. 1: findings, or a failure while it ran. 2: wrong usage. 128 + n: ended by signal n.
"""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress

from advpipe.pipeline.core import signals, streams
from advpipe.pipeline.core.errors import AdvpipeError, os_error_line
from advpipe.pipeline.core.missing_library import missing_library_line
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.process.folder import undecodable
from advpipe.pipeline.process.unexpected_error import report_unexpected

FAILED, WRONG_USAGE = 1, 2


def report_failure(error: BaseException) -> int:
    """Print one line for the error that ended a command, and return the exit code."""
    signals.uninstall()
    number = signals.received()
    if number is None and isinstance(error, KeyboardInterrupt):
        number = getattr(error, "number", 2)
    if number is not None:
        _print_error(signals.last_line(number))
        return signals.exit_code(number)
    if isinstance(error, BrokenPipeError) and streams.is_reader_gone():
        streams.drop_output()
        return FAILED
    line, code = _line_and_code(error)
    _print_error(f"advpipe: {one_line(line)}")
    return code


def _line_and_code(error: BaseException) -> tuple[str, int]:
    match error:
        case AdvpipeError():
            return str(error), error.exit_code
        case ImportError() | OSError() if line := missing_library_line(error):
            return line, FAILED
        case OSError() if _is_folder_deleted():
            return "the working directory was deleted; change to one that exists (cd)", FAILED
        case OSError():
            return os_error_line(error), FAILED
        case UnicodeEncodeError():
            return _encoding_line(error), WRONG_USAGE
        case _:
            return report_unexpected(error), FAILED


def _encoding_line(error: UnicodeEncodeError) -> str:
    """The line for a name that is not UTF-8 and cannot be written, or that the locale cannot encode."""
    before, after = error.object[: error.start], error.object[error.start :]
    name = re.split(r"[\n\"']", before)[-1] + re.split(r"[\n\"']", after)[0]
    return undecodable(name, error.encoding)


def _is_folder_deleted() -> bool:
    try:
        os.getcwd()
    except OSError:
        return True
    return False


def _print_error(line: str) -> None:
    with suppress(OSError, ValueError):  # standard error is closed or full: only the exit code remains
        print(line, file=sys.stderr, flush=True)
