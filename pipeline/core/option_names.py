"""How errors name an option: `--overwrite` on the command line, `overwrite=True` in Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

_FLAGS = {
    "settings": "set",
    "lidar_height_m": "lidar-height",
    "interval_s": "interval",
    "classes": "class",
    "start_s": "start",
    "clock_hz": "clock",
    "delay_s": "delay",
    "duration_s": "duration",
}
"""Options whose flag is not the Python name with dashes."""

_is_command_line = False


def is_command_line() -> bool:
    """Whether the command line runs in this process, rather than a program that uses the Python API."""
    return _is_command_line


@contextmanager
def use_flags(is_command_line: bool = True) -> Iterator[None]:
    """Within the block, errors name options as the command line or as Python does."""
    global _is_command_line
    before, _is_command_line = _is_command_line, is_command_line
    try:
        yield
    finally:
        _is_command_line = before


def option_name(name: str, value: object = None) -> str:
    """The option of this Python name, with the value that a user is to give it, if any.

    >>> option_name("frames", "start:stop:step")
    "frames='start:stop:step'"
    """
    if not _is_command_line:
        return name if value is None else f"{name}={value!r}"
    flag = "--" + _FLAGS.get(name, name).replace("_", "-")
    return flag if value is None or value is True else f"{flag} {value}"
