"""The parts of Canonical Octet Encoding Rules (ITU-T X.696) that certificates and envelopes need."""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError

MOST_LENGTH_BYTES = 2


class EnvelopeError(AdvpipeError):
    """The bytes are no certificate or envelope of the profile that advpipe reads."""


def length_prefixed(data: bytes) -> bytes:
    """An OCTET STRING of variable length, or an open type: the length, then the bytes."""
    size = len(data)
    if size < 0x80:
        return bytes([size]) + data
    octets = size.to_bytes((size.bit_length() + 7) // 8, "big")
    return bytes([0x80 | len(octets)]) + octets + data


class CoerReader:
    """Reads bytes from the front. Every method raises EnvelopeError for bytes that do not fit."""

    def __init__(self, data: bytes) -> None:
        self._data, self.position = data, 0

    def take(self, size: int) -> bytes:
        """The next bytes."""
        end = self.position + size
        if end > len(self._data):
            raise EnvelopeError(f"the envelope ends after {len(self._data)} bytes, within a value")
        taken = self._data[self.position : end]
        self.position = end
        return taken

    def unsigned(self, size: int) -> int:
        """An unsigned number of this many bytes."""
        return int.from_bytes(self.take(size), "big")

    def expect(self, data: bytes, what: str) -> None:
        """These bytes, which the profile fixes."""
        if (found := self.take(len(data))) != data:
            raise EnvelopeError(
                f"{what} is {found.hex()}, which advpipe does not read; it reads {data.hex()}"
            )

    def length(self) -> int:
        """A length determinant in its shortest form."""
        first = self.unsigned(1)
        if first < 0x80:
            return first
        if not 1 <= (size := first & 0x7F) <= MOST_LENGTH_BYTES:
            raise EnvelopeError(f"a length in {size} bytes is none of 1 to {MOST_LENGTH_BYTES}")
        length = self.unsigned(size)
        if length < 0x80 or length.bit_length() <= 8 * (size - 1):
            raise EnvelopeError("a length is not in its shortest form")
        return length

    def octets(self) -> bytes:
        """An OCTET STRING of variable length."""
        return self.take(self.length())

    def end(self) -> None:
        """Nothing is left."""
        if left := len(self._data) - self.position:
            raise EnvelopeError(f"{left} bytes follow the envelope")

    def since(self, position: int) -> bytes:
        """The bytes read since a position."""
        return self._data[position : self.position]
