"""The one error that a user may see."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager


class AdvpipeError(Exception):
    """A mistake outside advpipe's code, said in one line: what, where, and how to mend it.

    The command line prints the message and exits with `exit_code`, without a traceback.
    """

    exit_code = 1


class OutputExistsError(AdvpipeError):
    """An output is there already, and `--overwrite` was not given."""

    def __init__(self, path: object) -> None:
        super().__init__(f"{path} exists already, not overwriting; pass --overwrite to replace it")


def one_line(text: object) -> str:
    """Text on one line that a terminal shows and does not obey: what cannot be printed is spelt out."""
    words = " ".join(str(text).split())
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in words)


def os_error_line(error: OSError) -> str:
    """What the operating system refused, as one line: the file, and why."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        reason += "; make room there, or write elsewhere (--out)"
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
