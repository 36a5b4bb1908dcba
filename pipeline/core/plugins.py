"""Plug-ins (users' attacks and detectors): turns their exceptions into one-line errors with file and line."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from advpipe.pipeline.core.code import PACKAGE
from advpipe.pipeline.core.errors import AdvpipeError

T = TypeVar("T")

_FOREIGN_FOLDERS = (
    *(PACKAGE / folder for folder in ("pipeline", "stages")),
    *(Path(sysconfig.get_path(which)) for which in ("stdlib", "purelib", "platlib")),
)
"""Folders of code that the user did not write."""


def plugin_names(names: Iterable[str]) -> tuple[str, ...]:
    """The names of the form `module:Class`, which are plug-ins, among names of attacks and detectors."""
    return tuple(dict.fromkeys(name for name in names if ":" in name))


def user_class(instance: object) -> tuple[str, ...]:
    """`module:Class` of an object whose class is the user's; an empty tuple for a class of advpipe."""
    cls = type(instance)
    return () if cls.__module__.startswith("advpipe.") else (f"{cls.__module__}:{cls.__qualname__}",)


def with_plugin_errors(
    prepare: Callable[[], Callable[[int], T]], plugins: Sequence[str]
) -> Callable[[int], T]:
    """The function that `prepare` returns, with exceptions in plug-ins raised as by `plugin_errors`."""
    with plugin_errors(plugins):
        work = prepare()

    def work_with_errors(job: int) -> T:
        with plugin_errors(plugins):
            return work(job)

    return work_with_errors


@contextmanager
def plugin_errors(plugins: Sequence[str]) -> Iterator[None]:
    """Raise AdvpipeError, one line, for any exception in the block; without plug-ins, leave it unchanged.

    plugins: the names of the plug-ins that run in the block. A SystemExit in a plug-in is an error, too: the
    program would end without a message.
    """
    try:
        yield
    except (AdvpipeError, OSError):  # already a one-line error
        raise
    except (Exception, SystemExit) as error:
        if not plugins:
            raise
        reason = " ".join(str(error).split())
        raise AdvpipeError(
            f"{' or '.join(plugins)} failed: {type(error).__name__}: {reason}{_place(error)}; fix it"
        ) from None


def _place(error: BaseException) -> str:
    """File and line of the innermost call in the user's code; "" if there is none."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        path = Path(frame.filename)
        if path.is_file() and not any(path.is_relative_to(folder) for folder in _FOREIGN_FOLDERS):
            return f" ({path.name}, line {frame.lineno})"
    return ""
