"""Errors that are shown to the user: each is one line and has an exit code."""

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
    """A failure that is not a defect of advpipe; its one-line message states what, where, and how to fix it.

    The command line prints the message and exits with `exit_code`, without a traceback.
    """

    exit_code = 1


class UsageError(AdvpipeError):
    """The command as given cannot be carried out: an unknown name, a bad value, an input of the wrong type.

    A failure while it runs, such as a full disk or a damaged file, is an AdvpipeError.
    """

    exit_code = 2


class OutputExistsError(UsageError):
    """An output exists already, and may not be replaced."""

    def __init__(self, path: object) -> None:
        super().__init__(f"{path} already exists; pass {option_name('overwrite', True)} to replace it")


@contextmanager
def as_usage_error() -> Iterator[None]:
    """Raise UsageError for any AdvpipeError in the block: there, only the user's input can be wrong."""
    try:
        yield
    except UsageError:
        raise
    except AdvpipeError as error:
        raise UsageError(str(error)) from error


def os_error_line(error: OSError) -> str:
    """An error of the operating system as one line: the file and the reason."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        reason += f"; free some space, or write elsewhere ({option_name('out')})"
    return f"{error.filename}: {reason}" if error.filename else reason


@contextmanager
def writing(place: object) -> Iterator[None]:
    """Name the output `place` in the error of a full disk, where the operating system names no file.

    Raises AdvpipeError for such an error in the block; other errors pass through.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) or error.filename:
            raise
        raise AdvpipeError(f"{place}: cannot be written: {os_error_line(error)}") from None
