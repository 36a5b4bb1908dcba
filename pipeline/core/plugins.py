"""Attacks and detectors of a user's own: a mistake in one is told in a line, with its place."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.core.code import PACKAGE
from advpipe.pipeline.core.errors import AdvpipeError

Work = Callable[[int], None]

_OF_OTHERS = (
    *(PACKAGE / folder for folder in ("pipeline", "stages")),
    *(Path(sysconfig.get_path(which)) for which in ("stdlib", "purelib", "platlib")),
)
"""Where code lies that is not the user's."""


def plugin_names(words: Iterable[str]) -> tuple[str, ...]:
    """Those of the attacks and detectors that are named `module:Class`."""
    return tuple(dict.fromkeys(word for word in words if ":" in word))


def user_class(of_use: object) -> tuple[str, ...]:
    """`module:Class` of a detector that is the user's own; nothing for one of ours."""
    kind = type(of_use)
    return () if kind.__module__.startswith("advpipe.") else (f"{kind.__module__}:{kind.__qualname__}",)


def with_plugin_errors(prepare: Callable[[], Work], own: Sequence[str]) -> Work:
    """The work that `prepare` makes, with mistakes in code of the user's own reported in one line."""
    with plugin_errors(own):
        work = prepare()

    def work_and_tell(job: int) -> None:
        with plugin_errors(own):
            work(job)

    return work_and_tell


@contextmanager
def plugin_errors(own: Sequence[str]) -> Iterator[None]:
    """Raises AdvpipeError, one line, for whatever goes wrong inside; as it is where nothing is `own`.

    A program that ends itself goes wrong, too: it leaves nothing behind, and no word why.
    """
    try:
        yield
    except (AdvpipeError, OSError):  # said in one line as they are
        raise
    except (Exception, SystemExit) as error:
        if not own:
            raise
        reason = " ".join(str(error).split())
        raise AdvpipeError(
            f"{' or '.join(own)} failed: {type(error).__name__}: {reason}{_place(error)}; fix it"
        ) from None


def _place(error: BaseException) -> str:
    """File and line of the user's that the error came through last; "" if there is none."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        path = Path(frame.filename)
        if path.is_file() and not any(path.is_relative_to(folder) for folder in _OF_OTHERS):
            return f" ({path.name}, line {frame.lineno})"
    return ""
