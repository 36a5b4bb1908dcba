"""The one header that a file of a name and size gets in our archives: POSIX ustar, with pax where it must.

Owner, group and times are 0, so that equal data sets give equal archives; a reader makes the header again
from the name and size it found and compares all bytes. So a changed header is refused, or, where pax records
hold them without a checksum, tells another name or size.
"""

from __future__ import annotations

import re
import struct

BLOCK_BYTES = 512
RECORD_BYTES = 10_240
"""An archive's length is a multiple of it, and it ends in at least two blocks of zeros (POSIX.1, pax)."""

# name, mode, uid, gid, size, mtime, chksum, typeflag, linkname, magic and version, uname, gname, devmajor,
# devminor, prefix
_FIELDS = struct.Struct("100s8s8s8s12s12s8sc100s8s32s32s8s8s155s12x")
_PAX_NAME = b"././@PaxHeader"
_PAX = re.compile(rb"(?:\d{1,6} path=([^\n\0]*)\n)?(?:\d{1,6} size=(\d{1,20})\n)?\0*")
_LARGEST_USTAR_BYTES = 8**11 - 1
MOST_PAX_BYTES = 1 << 13


def padding(size_bytes: int) -> int:
    """How many zeros follow so many bytes in an archive."""
    return -size_bytes % BLOCK_BYTES


def tar_header(name: str, size_bytes: int) -> bytes:
    """The header of a regular file, one block or with a pax header three and more.

    The bytes are those of Python's tarfile for a TarInfo of this name and size, in pax format.
    """
    records = b""
    if len(name.encode()) > 100 or not name.isascii():
        records += _record(b"path", name.encode())
    if size_bytes > _LARGEST_USTAR_BYTES:
        records += _record(b"size", b"%d" % size_bytes)
        size_bytes = 0
    pax = b""
    if records:
        pax = _block(_PAX_NAME, 0, len(records), b"x") + records + bytes(padding(len(records)))
    return pax + _block(name.encode("ascii", "replace")[:100], 0o644, size_bytes, b"0")


def pax_length(block: bytes) -> int | None:
    """Bytes of the pax records that follow this block, padded; None where it is no pax header.

    Raises ValueError for a length that no header of ours has.
    """
    if block[156:157] != b"x":
        return None
    length = _octal(block[124:136])
    if length > MOST_PAX_BYTES:
        raise ValueError("pax header too long")
    return length + padding(length)


def parse_header(records: bytes, block: bytes) -> tuple[str, int]:
    """Name and size in bytes from pax records, if any, and a file's block.

    Raises ValueError for bytes that are no header. The result is to be put into `tar_header` and compared.
    """
    match = _PAX.fullmatch(records)
    if match is None:
        raise ValueError("unknown pax header")
    path, size = match.groups()
    name = path if path is not None else block[:100].rstrip(b"\0")
    return name.decode(), int(size) if size is not None else _octal(block[124:136])


def _octal(field: bytes) -> int:
    digits = field.rstrip(b" \0")
    if not re.fullmatch(rb"[0-7]+", digits):
        raise ValueError("no octal number")
    return int(digits, 8)


def _record(key: bytes, value: bytes) -> bytes:
    """`LENGTH key=value` and a new line, the length counting itself."""
    rest = b" %s=%s\n" % (key, value)
    length = len(rest)
    while length != len(rest) + len(str(length)):
        length = len(rest) + len(str(length))
    return str(length).encode() + rest


def _block(name: bytes, mode: int, size_bytes: int, kind: bytes) -> bytes:
    def filled(checksum: bytes) -> bytes:
        return _FIELDS.pack(
            name, b"%07o" % mode, zero, zero, b"%011o" % size_bytes, b"%011o" % 0, checksum, kind, b"",
            b"ustar\x0000", b"", b"", b"", b"", b"",
        )  # fmt: skip

    zero = b"%07o" % 0
    return filled(b"%06o\0 " % sum(filled(b" " * 8)))
