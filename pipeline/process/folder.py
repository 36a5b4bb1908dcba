"""The working directory, which may have been deleted: then only absolute paths are valid."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.remote_path import located

_is_deleted = False


def leave_deleted_folder() -> None:
    """Change to the root if the working directory was deleted, where some libraries abort the process."""
    global _is_deleted
    try:
        os.getcwd()
    except OSError:
        _is_deleted = True
        os.chdir(os.path.abspath(os.sep))


def working_path(path: str | Path) -> Path:
    """The path as a Path. Raises UsageError for a relative path if the working directory was deleted."""
    if _is_deleted and not Path(path).is_absolute():
        raise UsageError(
            f"{path}: the working directory was deleted; change to one that exists (cd), or give "
            "absolute paths"
        )
    return Path(path)


def usable(value: Any) -> Any:
    """The value of an option, or a list of values; paths are as `working_path` and `located` have them."""
    if isinstance(value, list):
        return [usable(one) for one in value]
    return located(working_path(value)) if isinstance(value, Path) else value


def refuse_undecodable(*paths: Path | None) -> None:
    """Raise UsageError for a name that is not UTF-8, which tables and reports cannot hold."""
    for path in paths:
        try:
            str(path).encode()
        except UnicodeEncodeError:
            raise UsageError(undecodable(path)) from None


def undecodable(name: object, encoding: str = "utf-8") -> str:
    """One line on a name that an encoding cannot write, with the fix: rename it, or change the locale."""
    if "utf" in encoding.lower() and "utf" in sys.getfilesystemencoding():
        return f"{name}: invalid UTF-8, which tables, reports and checkpoints cannot hold; rename it"
    return f"{name}: this locale cannot encode it; set LC_ALL=C.UTF-8"
