"""Counts in a message's bytes how many Python objects it would become, before they are made.

A few compressed kilobytes can become a message of millions of transforms, each of 17 objects.
"""

from __future__ import annotations

import struct
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde.utils import SIZEMAP
from rosbags.typesys.store import Typestore

_HEAD_BYTES = 4  # the encapsulation header; its second byte states the byte order, alignment starts after it


def has_more_objects(store: Typestore, type_name: str, cdr: bytes, limit: int) -> bool:
    """Whether a message holds more than `limit` messages, strings, numbers and arrays of numbers.

    An array or a sequence of numbers is one object. False for bytes that are not a message of the type.
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
    """Walks through a message; offsets are counted from the end of the encapsulation header."""

    def __init__(self, store: Typestore, cdr: bytes, left: int) -> None:
        self._fields, self._data, self._left = store.fielddefs, memoryview(cdr)[_HEAD_BYTES:], left
        self._length = struct.Struct("<I" if cdr[1] & 1 else ">I")

    def skip_type(self, name: str, offset: int) -> int:
        """The offset after a message of this type that begins at `offset`."""
        self._add()
        for _, field in self._fields[name][1]:
            offset = self._skip(field, offset)
        return offset

    def _skip(self, field: Any, offset: int) -> int:
        node_type, detail = field
        if node_type == Nodetype.NAME:
            return self.skip_type(detail, offset)
        self._add()
        if node_type == Nodetype.BASE:
            return self._skip_string(offset) if detail[0] == "string" else _after(1, detail, offset)
        item, length = detail
        if node_type == Nodetype.SEQUENCE:
            length, offset = self._read_length(offset)
        if item[0] == Nodetype.BASE and item[1][0] != "string":
            return _after(length, item[1], offset)
        for _ in range(length):
            offset = self._skip(item, offset)
        return offset

    def _skip_string(self, offset: int) -> int:
        length, offset = self._read_length(offset)
        return offset + length

    def _read_length(self, offset: int) -> tuple[int, int]:
        start = _aligned(offset, self._length.size)
        return self._length.unpack_from(self._data, start)[0], start + self._length.size

    def _add(self) -> None:
        self._left -= 1
        if self._left < 0:
            raise _TooManyError


def _after(count: int, base: tuple[str, int], offset: int) -> int:
    """The offset after `count` numbers."""
    size = SIZEMAP[base[0]]  # type: ignore[index]
    return _aligned(offset, size) + size * count if count else offset


def _aligned(offset: int, size: int) -> int:
    return (offset + size - 1) & -size
