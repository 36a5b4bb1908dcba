"""Runs one case, and reports a fault in its ending: the one definition of "handled"."""

from __future__ import annotations

import os
import shutil
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from tests.fuzz.case import Case, Fault, Target, Unhandled

LONGEST_LINE = 2000
LONGEST_MESSAGE = 20_000
"""Limit on an error before the command line truncates it: more is a whole document."""
"""Characters of an error: room for a path and some names, and for no document."""

PROJECT = ("pipeline", "stages")
OUTSIDE = "outside of advpipe"
ROOT = Path(__file__).parents[2]


def attempt(target: Target, case: Case, base: Path, scratch: Path) -> Fault | None:
    """Lays out the base documents with the case's file, and makes its call; None where that was handled."""
    tree, out = scratch / "tree", scratch / "out"
    for folder in (tree, out):
        shutil.rmtree(folder, ignore_errors=True)
    lay_out(base / target.part, tree, case)
    out.mkdir()
    with _inside(scratch):
        return judge(target, case, tree, out)


def lay_out(base: Path, tree: Path, case: Case) -> None:
    """Copy the base as hard links, since no call writes to its input, and put the case's file in it."""
    shutil.copytree(base, tree, copy_function=os.link)
    place = tree / case.place
    place.unlink(missing_ok=True)
    place.write_bytes(case.data)


def judge(target: Target, case: Case, tree: Path, out: Path) -> Fault | None:
    """What is wrong with how the call ends, if anything."""
    try:
        shown = target.calls[case.call](tree, out)
    except AdvpipeError as error:
        return _line_fault(error) or _leftover_fault(out)
    except Unhandled as error:
        return error.fault
    except Exception as error:
        if innermost(error.__traceback__) == OUTSIDE:
            raise  # a mistake of the fuzzer's own
        return Fault("exception", describe(error), innermost(error.__traceback__), trace_of(error))
    return None if shown is None else _terminal_fault(str(shown))


def describe(error: BaseException) -> str:
    return f"{type(error).__name__}: {one_line(error)[:200]}"


def trace_of(error: BaseException) -> str:
    return "".join(traceback.format_exception(error, limit=-40))


def innermost(trace: TracebackType | None) -> str:
    """File, function and line of the innermost frame in advpipe's own code."""
    for frame in reversed(traceback.extract_tb(trace)):
        path = Path(frame.filename)
        if path.is_relative_to(ROOT) and path.relative_to(ROOT).parts[0] in PROJECT:
            return f"{path.relative_to(ROOT).as_posix()}:{frame.lineno} {frame.name}"
    return OUTSIDE


def _line_fault(error: AdvpipeError) -> Fault | None:
    line, where = one_line(error), innermost(error.__traceback__)
    if not line:
        return Fault("line", "an error without a word", where)
    if len(str(error)) > LONGEST_MESSAGE or len(line) > LONGEST_LINE:
        return Fault("line", f"an error of {len(str(error))} characters: {line[:100]}...", where)
    return None


def _leftover_fault(out: Path) -> Fault | None:
    names = [path.name for path in sorted(out.iterdir()) if not path.name.startswith(".")]
    return Fault("leftover", f"a refused call left {', '.join(names)[:100]}") if names else None


def _terminal_fault(text: str) -> Fault | None:
    bad = next((sign for sign in text if not sign.isprintable() and sign not in "\n "), None)
    if bad is None:
        return None
    line = next(line for line in text.splitlines() or [text] if bad in line or bad in "\r\x0b\x0c\x85")
    return Fault("terminal", f"{bad!a} reaches the terminal: {one_line(line)[:100]}")


@contextmanager
def _inside(folder: Path) -> Iterator[None]:
    """Works in a folder, so that nothing relative is written elsewhere."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
