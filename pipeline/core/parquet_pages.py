"""Headers of Parquet pages: what each page unpacks to, whatever the file's footer says of it.

A footer is believed by readers and may lie; they unpack page by page, as much as the page's header says.
Where the pages of a column lie is read here from the footer, too: pyarrow ends the process where what it
says of a column does not fit the rest, encryption and histograms of levels among it.
Source: parquet-format 2.11, parquet.thrift, in Thrift's compact protocol.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

USUAL_HEADER = 1 << 9
LONGEST_HEADER = 1 << 16
"""A header holds the page's least and largest value, which are cut by those who write long ones."""

ENCODINGS = {0: "plain", 2: "dictionary", 3: "RLE", 4: "bits", 5: "delta", 8: "dictionary", 9: "byte streams"}
"""Encodings that unpack a batch at a time. Those of texts as differences (6, 7) make any length at once."""

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_MOST_LEVELS = 8


@dataclass(frozen=True)
class Page:
    """One page of a column: its bytes in the file and unpacked; encoding: its number."""

    compressed_bytes: int
    uncompressed_bytes: int
    encoding: int
    is_dictionary: bool


def pages(file: IO[bytes], start: int, length: int) -> Iterator[Page]:
    """The pages between two places of a file; raises ValueError where there is none."""
    here, end = start, start + length
    while here < end:
        page, header_bytes = _read(file, here)
        yield page
        here += header_bytes + page.compressed_bytes


@dataclass(frozen=True)
class Chunk:
    """Where the pages of one column in one group of rows lie."""

    start: int
    length: int


def column_chunks(footer: bytes) -> list[list[Chunk]]:
    """Of each group of rows its columns, as a file's footer has them; ValueError for what is no footer."""
    try:
        groups = _Compact(footer).struct().get(4, [])
        return [[_chunk(column[3]) for column in group[1]] for group in groups]
    except (KeyError, TypeError, AttributeError):
        raise ValueError("the footer lists no columns") from None


def _chunk(about: dict[int, Any]) -> Chunk:
    length, places = about[7], [place for place in (about[9], about.get(11)) if place]
    if not all(isinstance(value, int) and value >= 0 for value in (length, *places)):
        raise ValueError("a column has no valid offset")
    return Chunk(min(places, default=0), length)  # a table without rows has no data page


def _read(file: IO[bytes], place: int) -> tuple[Page, int]:
    """The page at a place, and the length of its header."""
    for most in (USUAL_HEADER, LONGEST_HEADER):
        file.seek(place)
        header = _Compact(file.read(most))
        try:
            return _page(header.struct()), header.at
        except ValueError:
            if most == LONGEST_HEADER:
                raise
    raise AssertionError


def _page(fields: dict[int, Any]) -> Page:
    kind, unpacked, packed = (fields.get(number) for number in (1, 2, 3))
    own = fields.get({0: 5, 2: 7, 3: 8}.get(kind, 0) if isinstance(kind, int) else 0)
    encoding = own.get(4 if kind == 3 else 2) if isinstance(own, dict) else None
    sizes = (unpacked, packed, encoding)
    if not all(isinstance(size, int) and not isinstance(size, bool) and size >= 0 for size in sizes):
        raise ValueError("a page has no header")
    return Page(packed, unpacked, encoding, kind == 2)  # type: ignore[arg-type]


class _Compact:
    """Reads one struct; what is cut off, or nested without end, is a ValueError."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at = data, 0

    def struct(self, level: int = 0) -> dict[int, Any]:
        """Fields by number."""
        if level > _MOST_LEVELS:
            raise ValueError("a page header is nested too deeply")
        fields: dict[int, Any] = {}
        number = 0
        while (head := self._byte()) != 0:
            number = number + (head >> 4) if head >> 4 else self._signed()
            fields[number] = self._value(head & 15, level)
        return fields

    def _value(self, kind: int, level: int) -> Any:
        if kind in (_TRUE, _FALSE):
            return kind == _TRUE
        if kind == _BYTE:
            return self._byte()
        if kind in (_I16, _I32, _I64):
            return self._signed()
        if kind == _DOUBLE:
            return self._skip(8)
        if kind == _BINARY:
            return self._skip(self._unsigned())
        if kind in (_LIST, _SET):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._unsigned()
            if count > LONGEST_HEADER:
                raise ValueError("a page header holds too long a list")
            return [self._item(head & 15, level + 1) for _ in range(count)]
        if kind == _STRUCT:
            return self.struct(level + 1)
        raise ValueError(f"a page header holds a value of unknown type {kind}")

    def _item(self, kind: int, level: int) -> Any:
        """A value in a list, where true and false are bytes."""
        return self._byte() == _TRUE if kind in (_TRUE, _FALSE) else self._value(kind, level)

    def _byte(self) -> int:
        if self.at >= len(self._data):
            raise ValueError("a page header is truncated or too long")
        self.at += 1
        return self._data[self.at - 1]

    def _skip(self, count: int) -> None:
        self.at += count
        if self.at > len(self._data):
            raise ValueError("a page header is truncated or too long")

    def _unsigned(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7
            if shift > 63:
                raise ValueError("a page header holds an unterminated integer")

    def _signed(self) -> int:
        value = self._unsigned()
        return (value >> 1) ^ -(value & 1)
