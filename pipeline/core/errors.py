"""The errors that a user may see, each in one line, and with an exit code."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.text import one_line

__all__ = [
    "AdvpipeError",
    "OutputExistsError",
    "UsageError",
    "as_usage_error",
    "one_line",
    "os_error_line",
    "writing",
]


class AdvpipeError(Exception):
    """What went wrong outside advpipe's code, said in one line: what, where, and how to fix it.

    The command line prints the message and exits with `exit_code`, without a traceback.
    """

    exit_code = 1


class UsageError(AdvpipeError):
    """The command cannot be carried out as it was given: an unknown name, a bad value, an input that is none.

    What fails on the way, such as a full disk or a file that turns out to be damaged, is an AdvpipeError.
    """

    exit_code = 2


class OutputExistsError(UsageError):
    """An output is there already, and is not to be overwritten."""

    def __init__(self, path: object) -> None:
        super().__init__(f"{path} already exists; pass {option_name('overwrite', True)} to replace it")


@contextmanager
def as_usage_error() -> Iterator[None]:
    """Raises UsageError for any AdvpipeError inside: there, only what the user gave can be wrong."""
    try:
        yield
    except UsageError:
        raise
    except AdvpipeError as error:
        raise UsageError(str(error)) from error


def os_error_line(error: OSError) -> str:
    """What the operating system refused, as one line: the file, and why."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        reason += f"; free some space, or write elsewhere ({option_name('out')})"
    return f"{error.filename}: {reason}" if error.filename else reason


@contextmanager
def writing(place: object) -> Iterator[None]:
    """Names the output in a full disk's error, which the operating system does not."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) or error.filename:
            raise
        raise AdvpipeError(f"{place}: cannot be written: {os_error_line(error)}") from None
