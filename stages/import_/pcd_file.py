"""Reads clouds of the Point Cloud Library's format PCD: text, binary, and compressed by LZF."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.import_.point_fields import MOST_POINTS, Array, read_exactly

_MOST_LINES, _LONGEST_LINE = 64, 4096
_MOST_FIELDS, _MOST_POINT_BYTES = 256, 4096
_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True)
class _Header:
    point_dtype: np.dtype[np.void]
    points: int
    form: str


def read_pcd(file: Path) -> Mapping[str, Array]:
    """The fields of a PCD file by name, each (N,), of several values the first. Raises AdvpipeError."""
    with file.open("rb") as stream:
        header = _read_header(stream)
        if header.form == "ascii":
            points = _read_text(stream, header)
        elif header.form == "binary":
            points = _read_binary(stream, header)
        else:
            return _read_compressed(stream, header)
    return {name: _first_value(points[name]) for name in points.dtype.names or () if not name.startswith("_")}


def _first_value(values: Array) -> Array:
    return values if values.ndim == 1 else values[:, 0]


def _read_header(stream: BinaryIO) -> _Header:
    words: dict[str, list[str]] = {}
    for _ in range(_MOST_LINES):
        line = stream.readline(_LONGEST_LINE)
        text = line.decode("ascii", "replace").strip()
        if not line or (not line.endswith(b"\n") and len(line) == _LONGEST_LINE):
            break
        if not text or text.startswith("#"):
            continue
        key, *values = text.split()
        words[key.upper()] = values
        if key.upper() == "DATA":
            return _header_of(words)
    raise AdvpipeError("it has no line DATA in its header, so it is not a PCD file, or is truncated")


def _header_of(words: Mapping[str, list[str]]) -> _Header:
    names = words.get("FIELDS", words.get("COLUMNS", []))
    count = ["1"] * len(names)
    try:
        sizes, kinds = [int(text) for text in words.get("SIZE", ["4"] * len(names))], words["TYPE"]
        counts = [int(text) for text in words.get("COUNT", count)]
        points = int(words["POINTS"][0]) if "POINTS" in words else _area(words)
        form = words["DATA"][0].lower()
    except (KeyError, IndexError, ValueError):
        raise AdvpipeError("its PCD header is damaged: TYPE, SIZE, COUNT or POINTS") from None
    if not len(names) == len(sizes) == len(kinds) == len(counts) or not 0 < len(names) <= _MOST_FIELDS:
        raise AdvpipeError("its PCD header is damaged: FIELDS, SIZE, TYPE and COUNT differ in length")
    if form not in _FORMS:
        raise AdvpipeError(f"its points are stored as {form[:40]!r}; known are {', '.join(_FORMS)}")
    if not 0 <= points <= MOST_POINTS:
        raise AdvpipeError(f"it declares {points:,} points; a cloud has at most {MOST_POINTS:,}")
    return _Header(_point_dtype(names, sizes, kinds, counts), points, form)


def _area(words: Mapping[str, list[str]]) -> int:
    return int(words["WIDTH"][0]) * int(words["HEIGHT"][0])


def _point_dtype(
    names: list[str], sizes: list[int], kinds: list[str], counts: list[int]
) -> np.dtype[np.void]:
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for place, (name, size, kind, count) in enumerate(zip(names, sizes, kinds, counts, strict=True)):
        if size not in _SIZES.get(kind.upper(), ()) or not 0 < count <= _MOST_POINT_BYTES:
            raise AdvpipeError(f"its PCD header has a field of type {kind[:8]}, size {size}, count {count}")
        unique = name if name != "_" and name not in names[:place] else f"_{place}"
        fields.append((unique, f"<{_KINDS[kind.upper()]}{size}", () if count == 1 else (count,)))
    bytes_a_point = sum(size * count for size, count in zip(sizes, counts, strict=True))
    if bytes_a_point > _MOST_POINT_BYTES:
        raise AdvpipeError(f"its points have {bytes_a_point:,} bytes each; at most {_MOST_POINT_BYTES:,}")
    return np.dtype(fields)


def _read_binary(stream: BinaryIO, header: _Header) -> Array:
    data = read_exactly(stream, header.points * header.point_dtype.itemsize)
    return np.frombuffer(data, header.point_dtype)


def _read_text(stream: BinaryIO, header: _Header) -> Array:
    """Numbers as text; whole ones beyond 2**53, such as times since 1970 in nanoseconds, lose digits."""
    names = header.point_dtype.names or ()
    widths = [int(np.prod(header.point_dtype[name].shape, dtype=int)) for name in names]
    points = np.zeros(header.points, header.point_dtype)
    if not header.points:
        return points
    try:
        table = np.loadtxt(stream, np.float64, ndmin=2, max_rows=header.points, encoding="ascii")
    except (ValueError, UnicodeDecodeError):
        raise AdvpipeError("its points are not lines of numbers, one for each value of a field") from None
    if table.shape != (header.points, sum(widths)):
        raise AdvpipeError(
            f"it holds {table.shape[0]} points of {table.shape[1]} values, but its header declares "
            f"{header.points} of {sum(widths)}; it may be truncated"
        )
    with np.errstate(all="ignore"):
        for name, place in zip(names, np.cumsum([0, *widths[:-1]]), strict=True):
            points[name] = table[:, place : place + _width(points[name])].reshape(points[name].shape)
    return points


def _width(values: Array) -> int:
    return 1 if values.ndim == 1 else values.shape[1]


def _read_compressed(stream: BinaryIO, header: _Header) -> Mapping[str, Array]:
    """Field after field, all compressed together."""
    packed_bytes, size_bytes = struct.unpack("<II", read_exactly(stream, 8))
    expected = header.points * header.point_dtype.itemsize
    if size_bytes != expected:
        raise AdvpipeError(f"it unpacks to {size_bytes:,} bytes, but its points have {expected:,}")
    data = unpack_lzf(read_exactly(stream, packed_bytes), size_bytes)
    fields, offset = {}, 0
    for name in header.point_dtype.names or ():
        of_field = header.point_dtype[name]
        values = np.frombuffer(
            data, of_field.base, header.points * of_field.itemsize // of_field.base.itemsize, offset
        )
        offset += values.nbytes
        if not name.startswith("_"):
            fields[name] = _first_value(values.reshape(header.points, *of_field.shape))
    return fields


def unpack_lzf(packed: bytes, size_bytes: int) -> bytearray:
    """Undo LZF (M. Lehmann's liblzf): runs of literal bytes, and copies of what was unpacked before.

    Raises AdvpipeError for data that do not unpack to just `size_bytes`.
    """
    out, place, end = bytearray(), 0, len(packed)
    try:
        while place < end and len(out) <= size_bytes:
            control = packed[place]
            place += 1
            if control < 32:
                out += packed[place : place + control + 1]
                place += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[place]
                place += 1
            begin = len(out) - ((control & 31) << 8 | packed[place]) - 1
            place += 1
            if begin < 0:
                raise IndexError
            length += 2
            while length > 0:  # a copy may read what it writes
                copied = out[begin : begin + length]
                out += copied
                length, begin = length - len(copied), begin + len(copied)
    except IndexError:
        out.clear()
    if len(out) != size_bytes:
        raise AdvpipeError("its compressed points are damaged")
    return out
