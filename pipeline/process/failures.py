"""How a command fails: in one line, and with an exit code.

0: done. 1: findings, or something failed on the way. 2: wrong use. 128 + n: ended by signal n.
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

FAILED, WRONG_USE = 1, 2


def report_failure(error: BaseException) -> int:
    """Prints the line of an error that ended a command; returns the exit code."""
    signals.uninstall()
    number = signals.received()
    if number is None and isinstance(error, KeyboardInterrupt):
        number = getattr(error, "number", 2)
    if number is not None:
        _say(signals.last_line(number))
        return signals.exit_code(number)
    if isinstance(error, BrokenPipeError) and streams.is_reader_gone():
        streams.drop_output()
        return FAILED
    line, code = _told(error)
    _say(f"advpipe: {one_line(line)}")
    return code


def _told(error: BaseException) -> tuple[str, int]:
    match error:
        case AdvpipeError():
            return str(error), error.exit_code
        case ImportError() | OSError() if line := missing_library_line(error):
            return line, FAILED
        case OSError() if _folder_is_gone():
            return "the working directory was deleted; change to one that exists (cd)", FAILED
        case OSError():
            return os_error_line(error), FAILED
        case UnicodeEncodeError():
            return _unwritable(error), WRONG_USE
        case _:
            return report_unexpected(error), FAILED


def _unwritable(error: UnicodeEncodeError) -> str:
    """Of a name that is not UTF-8 and would have to go into a text, or that the locale cannot spell."""
    before, after = error.object[: error.start], error.object[error.start :]
    name = re.split(r"[\n\"']", before)[-1] + re.split(r"[\n\"']", after)[0]
    return undecodable(name, error.encoding)


def _folder_is_gone() -> bool:
    try:
        os.getcwd()
    except OSError:
        return True
    return False


def _say(line: str) -> None:
    with suppress(OSError, ValueError):  # standard error is closed or full: the exit code has to tell
        print(line, file=sys.stderr, flush=True)
