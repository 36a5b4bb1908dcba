"""Headers of Parquet pages: the decompressed size of each page, whatever the file's footer states.

Readers trust the footer, which may be false, but decompress as many bytes as each page's header states.
The offsets of the pages are read from the footer here, too: pyarrow aborts the process if a column's metadata
is inconsistent, including that on encryption and level histograms.
Source: parquet-format 2.11, parquet.thrift, in Thrift's compact protocol.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

USUAL_HEADER = 1 << 9
LONGEST_HEADER = 1 << 16
"""A header holds the page's smallest and largest value; writers truncate long ones."""

ENCODINGS = {0: "plain", 2: "dictionary", 3: "RLE", 4: "bits", 5: "delta", 8: "dictionary", 9: "byte streams"}
"""Encodings that are decoded batch by batch. Delta encodings of strings (6, 7) decode all in one step."""

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_MOST_LEVELS = 8


@dataclass(frozen=True)
class Page:
    """One page of a column: its size in the file and decompressed; encoding: the number of its encoding."""

    compressed_bytes: int
    uncompressed_bytes: int
    encoding: int
    is_dictionary: bool


def pages(file: IO[bytes], start: int, length: int) -> Iterator[Page]:
    """The pages in `length` bytes of a file from offset `start`. Raises ValueError for an invalid header."""
    here, end = start, start + length
    while here < end:
        page, header_bytes = _read(file, here)
        yield page
        here += header_bytes + page.compressed_bytes


@dataclass(frozen=True)
class Chunk:
    """Offset and length in bytes of the pages of one column in one row group."""

    start: int
    length: int


def column_chunks(footer: bytes) -> list[list[Chunk]]:
    """The column chunks of each row group, from a file's footer. Raises ValueError for an invalid footer."""
    try:
        groups = _Compact(footer).struct().get(4, [])
        return [[_chunk(column[3]) for column in group[1]] for group in groups]
    except (KeyError, TypeError, AttributeError):
        raise ValueError("the footer lists no columns") from None


def _chunk(metadata: dict[int, Any]) -> Chunk:
    length, offsets = metadata[7], [offset for offset in (metadata[9], metadata.get(11)) if offset]
    if not all(isinstance(value, int) and value >= 0 for value in (length, *offsets)):
        raise ValueError("a column has no valid offset")
    return Chunk(min(offsets, default=0), length)  # a table without rows has no data page


def _read(file: IO[bytes], offset: int) -> tuple[Page, int]:
    """The page at an offset, and the length of its header."""
    for most in (USUAL_HEADER, LONGEST_HEADER):
        file.seek(offset)
        header = _Compact(file.read(most))
        try:
            return _page(header.struct()), header.at
        except ValueError:
            if most == LONGEST_HEADER:
                raise
    raise AssertionError


def _page(fields: dict[int, Any]) -> Page:
    page_type, uncompressed, compressed = (fields.get(number) for number in (1, 2, 3))
    header = fields.get({0: 5, 2: 7, 3: 8}.get(page_type, 0) if isinstance(page_type, int) else 0)
    encoding = header.get(4 if page_type == 3 else 2) if isinstance(header, dict) else None
    sizes = (uncompressed, compressed, encoding)
    if not all(isinstance(size, int) and not isinstance(size, bool) and size >= 0 for size in sizes):
        raise ValueError("a page has no header")
    return Page(compressed, uncompressed, encoding, page_type == 2)  # type: ignore[arg-type]


class _Compact:
    """A reader of one struct; raises ValueError for truncated or too deeply nested data."""

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

    def _value(self, type_id: int, level: int) -> Any:
        if type_id in (_TRUE, _FALSE):
            return type_id == _TRUE
        if type_id == _BYTE:
            return self._byte()
        if type_id in (_I16, _I32, _I64):
            return self._signed()
        if type_id == _DOUBLE:
            return self._skip(8)
        if type_id == _BINARY:
            return self._skip(self._unsigned())
        if type_id in (_LIST, _SET):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._unsigned()
            if count > LONGEST_HEADER:
                raise ValueError("a page header holds too long a list")
            return [self._item(head & 15, level + 1) for _ in range(count)]
        if type_id == _STRUCT:
            return self.struct(level + 1)
        raise ValueError(f"a page header holds a value of unknown type {type_id}")

    def _item(self, type_id: int, level: int) -> Any:
        """A value in a list, where true and false are bytes."""
        return self._byte() == _TRUE if type_id in (_TRUE, _FALSE) else self._value(type_id, level)

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
