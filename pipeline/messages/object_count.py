"""How many Python objects a message would become, counted in its bytes before they are made.

Some kilobytes unpack to a message of millions of transforms, each of 17 objects.
"""

from __future__ import annotations

import struct
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde.utils import SIZEMAP
from rosbags.typesys.store import Typestore

_HEAD_BYTES = 4  # of encapsulation, whose second byte gives the byte order; alignment counts from its end


def has_more_objects(store: Typestore, type_name: str, cdr: bytes, limit: int) -> bool:
    """Whether a message holds more messages, texts, numbers and arrays of numbers than that.

    An array or a sequence of numbers is one object. False for bytes that are no message of the type.
    """
    try:
        _Count(store, cdr, limit).skip_type(type_name, 0)
    except _TooManyError:
        return True
    except (struct.error, LookupError, RecursionError):
        return False
    return False


class _TooManyError(Exception):
    pass


class _Count:
    """Goes over a message; places are bytes behind its head."""

    def __init__(self, store: Typestore, cdr: bytes, left: int) -> None:
        self._fields, self._data, self._left = store.fielddefs, memoryview(cdr)[_HEAD_BYTES:], left
        self._length = struct.Struct("<I" if cdr[1] & 1 else ">I")

    def skip_type(self, name: str, place: int) -> int:
        """Where what follows a message of this type begins."""
        self._add()
        for _, field in self._fields[name][1]:
            place = self._skip(field, place)
        return place

    def _skip(self, field: Any, place: int) -> int:
        kind, detail = field
        if kind == Nodetype.NAME:
            return self.skip_type(detail, place)
        self._add()
        if kind == Nodetype.BASE:
            return self._skip_text(place) if detail[0] == "string" else _after(1, detail, place)
        item, length = detail
        if kind == Nodetype.SEQUENCE:
            length, place = self._read_length(place)
        if item[0] == Nodetype.BASE and item[1][0] != "string":
            return _after(length, item[1], place)
        for _ in range(length):
            place = self._skip(item, place)
        return place

    def _skip_text(self, place: int) -> int:
        length, place = self._read_length(place)
        return place + length

    def _read_length(self, place: int) -> tuple[int, int]:
        start = _aligned(place, self._length.size)
        return self._length.unpack_from(self._data, start)[0], start + self._length.size

    def _add(self) -> None:
        self._left -= 1
        if self._left < 0:
            raise _TooManyError


def _after(count: int, base: tuple[str, int], place: int) -> int:
    """The end of so many numbers."""
    size = SIZEMAP[base[0]]  # type: ignore[index]
    return _aligned(place, size) + size * count if count else place


def _aligned(place: int, size: int) -> int:
    return (place + size - 1) & -size
