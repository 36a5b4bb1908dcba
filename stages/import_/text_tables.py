"""Small text files beside clouds: boxes, poses and times, a line each."""

from __future__ import annotations

import re
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr, shorten
from advpipe.pipeline.geometry.transforms import Float64, se3_from_quaternion
from advpipe.stages.import_.named_boxes import NamedBox

_MOST_BYTES = 1 << 26
_NS_PER_S = 1_000_000_000
_LATEST_NS = 1 << 62
_UNIT_NS = {10: 1_000_000_000, 13: 1_000_000, 16: 1000, 19: 1}
"""By the number of digits that a time since 1970 has in a unit, from 2001 to 2286."""

_DATE = re.compile(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d:\d\d)(?:\.(\d{1,9}))?Z?")


def read_rows(file: Path) -> list[tuple[int, list[str]]]:
    """The numbers and words of the lines that are neither empty nor comments. Raises AdvpipeError."""
    try:
        if file.stat().st_size > _MOST_BYTES:
            raise AdvpipeError(f"{file}: is larger than {_MOST_BYTES >> 20} MiB")
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise AdvpipeError(f"{file}: is not text in UTF-8") from None
    rows = ((number, line.replace(",", " ").split()) for number, line in enumerate(text.split("\n"), 1))
    return [(number, words) for number, words in rows if words and not words[0].startswith("#")]


def read_boxes(file: Path) -> list[NamedBox]:
    """Boxes of OpenPCDet's custom form: `x y z dx dy dz heading class`, and perhaps an id. AdvpipeError."""
    boxes = []
    for number, words in read_rows(file):
        if len(words) not in (8, 9):
            raise AdvpipeError(f"{file}:{number}: {len(words)} words, not x y z dx dy dz heading class")
        box = _numbers(file, number, words[:7])
        boxes.append(NamedBox(words[7], box, words[8] if len(words) == 9 else ""))
    return boxes


def read_poses(file: Path) -> tuple[list[int] | None, list[Float64]]:
    """Times in ns (None without them) and poses (4, 4): rows of a 3 x 4 matrix, or `t x y z qx qy qz qw`."""
    rows = read_rows(file)
    times: list[int] = []
    poses = []
    for number, words in rows:
        if len(words) != len(rows[0][1]) or len(words) not in (8, 12):
            raise AdvpipeError(
                f"{file}:{number}: {len(words)} numbers, neither 12 of a 3 x 4 matrix (KITTI) nor 8 of "
                "t x y z qx qy qz qw (TUM), the same in each line"
            )
        if len(words) == 12:
            values = _numbers(file, number, words)
            poses.append(np.vstack([np.reshape(values, (3, 4)), [0, 0, 0, 1]]))
            continue
        values = _numbers(file, number, words[1:])
        if not np.isclose(np.linalg.norm(values[3:]), 1, atol=0.05):
            raise AdvpipeError(f"{file}:{number}: qx qy qz qw is not a unit quaternion")
        times.append(_time(file, number, words[:1]))
        poses.append(se3_from_quaternion(values[3:], values[:3]))
    return (times or None), poses


def read_times(file: Path) -> list[int]:
    """A time a line, in ns since its epoch: numbers as in `time_ns`, or dates as KITTI writes them."""
    return [_time(file, number, words) for number, words in read_rows(file)]


def time_ns(text: str) -> int | None:
    """The time of a number in ns: whole ones of 13, 16 or 19 digits are ms, us or ns, all others seconds.

    None for a text that is no such number.
    """
    whole, dot, fraction = text.partition(".")
    if whole.isascii() and whole.isdigit() and len(whole) <= 19:
        if not dot and len(whole) in _UNIT_NS:
            return int(whole) * _UNIT_NS[len(whole)]
        if (not fraction or (fraction.isascii() and fraction.isdigit())) and len(whole) <= 10:
            return int(whole) * _NS_PER_S + int(fraction[:9].ljust(9, "0"))
    try:
        seconds = float(text)
    except ValueError:
        return None
    return round(seconds * _NS_PER_S) if 0 <= seconds < _LATEST_NS / _NS_PER_S else None


def _time(file: Path, number: int, words: list[str]) -> int:
    text = " ".join(words)
    if match := _DATE.fullmatch(text):
        try:
            date = datetime.fromisoformat(f"{match[1]} {match[2]}").replace(tzinfo=timezone.utc)
        except ValueError:
            raise AdvpipeError(f"{file}:{number}: {text} is no date") from None
        return int(date.timestamp()) * _NS_PER_S + int((match[3] or "0").ljust(9, "0"))
    found = time_ns(text)
    if found is None:
        raise AdvpipeError(f"{file}:{number}: {short_repr(text)} is no time")
    return found


def _numbers(file: Path, number: int, words: list[str]) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise AdvpipeError(f"{file}:{number}: {shorten(str(error))}") from None
    if not np.isfinite(values).all():
        raise AdvpipeError(f"{file}:{number}: a number is not finite")
    return values
