"""The working folder, which may have been deleted: then only absolute paths mean anything."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError

_is_gone = False


def leave_deleted_folder() -> None:
    """Goes to the root where the working folder does not exist: libraries end the process there otherwise."""
    global _is_gone
    try:
        os.getcwd()
    except OSError:
        _is_gone = True
        os.chdir(os.path.abspath(os.sep))


def working_path(path: str | Path) -> Path:
    """A path that may be relative; raises UsageError for one that is, in a folder that was deleted."""
    if _is_gone and not Path(path).is_absolute():
        raise UsageError(
            f"{path}: the working directory was deleted; change to one that exists (cd), or give "
            "absolute paths"
        )
    return Path(path)


def check_paths(values: Iterable[object]) -> None:
    """Applies `working_path` to all paths among the values of options, and in lists of them."""
    for value in values:
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, Path):
                working_path(one)


def refuse_undecodable(*paths: Path | None) -> None:
    """Raises UsageError for a name that is not UTF-8, which tables and reports cannot hold."""
    for path in paths:
        try:
            str(path).encode()
        except UnicodeEncodeError:
            raise UsageError(undecodable(path)) from None


def undecodable(name: object, encoding: str = "utf-8") -> str:
    """What to do about a name that cannot be written with an encoding; the locale may be to blame."""
    if "utf" in encoding.lower() and "utf" in sys.getfilesystemencoding():
        return f"{name}: invalid UTF-8, which tables, reports and checkpoints cannot hold; rename it"
    return f"{name}: this locale cannot encode it; set LC_ALL=C.UTF-8"
