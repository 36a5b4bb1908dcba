"""A fast codec in unaligned PER (ITU-T X.691) for the plain cases of a compiled ASN.1 type.

pycrate interprets its type object anew for every value; here, each part of the type is compiled once to a
function. Other cases (extensions used, values out of range, malformed bytes) raise `NotPlain`,
and pycrate handles them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class NotPlain(Exception):  # noqa: N818  not an error: pycrate takes over
    """This value or these bytes need pycrate."""


Write = Callable[[Any, int], int]
"""(value, bits so far) to bits; a leading one marks where they begin."""
Read = Callable[[int, int], tuple[Any, int]]
"""(all bits, number of bits left) to value and number of bits left afterwards."""


class _Part(NamedTuple):
    write: Write
    read: Read


class Uper:
    """Encoder and decoder of one type; without state, so that threads may share it.

    asn1: pycrate's object of the type.
    """

    def __init__(self, asn1: Any) -> None:
        self._part = _part(asn1)

    def encode(self, value: Any) -> bytes:
        """Encode a value. Raises NotPlain, or any Python error for a value of another shape."""
        bits = self._part.write(value, 1)
        padding = -(bits.bit_length() - 1) % 8
        bits <<= padding
        size = (bits.bit_length() - 1) // 8
        return (bits ^ (1 << 8 * size)).to_bytes(size, "big")

    def decode(self, data: bytes) -> Any:
        """Decode a value. Raises NotPlain, and ValueError for too few bytes."""
        value, left = self._part.read(int.from_bytes(data, "big"), 8 * len(data))
        if left >= 8:
            raise NotPlain
        return value


def _part(asn1: Any) -> _Part:
    return _PARTS.get(asn1.TYPE, _never_plain)(asn1)


def _never_plain(_: Any) -> _Part:
    """A text, or another type that messages hardly ever hold."""

    def write(value: Any, bits: int) -> int:
        raise NotPlain

    def read(bits: int, left: int) -> tuple[Any, int]:
        raise NotPlain

    return _Part(write, read)


def _number(low: int, high: int, extensible: bool) -> _Part:
    """A whole number in as many bits as its range takes, behind a zero if the range can be extended."""
    size = (high - low).bit_length()
    shift, mask = size + extensible, (1 << size + extensible) - 1

    def write(value: int, bits: int) -> int:
        if not low <= value <= high:
            raise NotPlain
        return bits << shift | value - low

    def read(bits: int, left: int) -> tuple[int, int]:
        left -= shift
        value = (bits >> left & mask) + low
        if value > high:
            raise NotPlain
        return value, left

    return _Part(write, read)


def _integer(asn1: Any) -> _Part:
    bounds = asn1._const_val.root[0]
    return _number(bounds.lb, bounds.ub, asn1._const_val.ext is not None)


def _enumerated(asn1: Any) -> _Part:
    names = list(asn1._root)
    place = {name: index for index, name in enumerate(names)}
    index = _number(0, len(names) - 1, asn1._ext is not None)

    def write(value: str, bits: int) -> int:
        return index.write(place[value], bits)

    def read(bits: int, left: int) -> tuple[str, int]:
        value, left = index.read(bits, left)
        return names[value], left

    return _Part(write, read)


def _boolean(asn1: Any) -> _Part:
    def write(value: bool, bits: int) -> int:
        if not isinstance(value, bool):
            raise NotPlain
        return bits << 1 | value

    def read(bits: int, left: int) -> tuple[bool, int]:
        left -= 1
        return bool(bits >> left & 1), left

    return _Part(write, read)


def _count(asn1: Any) -> _Part:
    """The number of bits, bytes or items ahead of them; of a fixed number, nothing."""
    size = asn1._const_sz.root[0]
    low, high = (size, size) if isinstance(size, int) else (size.lb, size.ub)
    return _number(low, high, asn1._const_sz.ext is not None)


def _bit_string(asn1: Any) -> _Part:
    count = _count(asn1)

    def write(value: tuple[int, int], bits: int) -> int:
        number, length = value
        if number >> length:
            raise NotPlain
        return count.write(length, bits) << length | number

    def read(bits: int, left: int) -> tuple[tuple[int, int], int]:
        length, left = count.read(bits, left)
        left -= length
        return (bits >> left & (1 << length) - 1, length), left

    return _Part(write, read)


def _octet_string(asn1: Any) -> _Part:
    count = _count(asn1)

    def write(value: bytes, bits: int) -> int:
        return count.write(len(value), bits) << 8 * len(value) | int.from_bytes(value, "big")

    def read(bits: int, left: int) -> tuple[bytes, int]:
        length, left = count.read(bits, left)
        left -= 8 * length
        return (bits >> left & (1 << 8 * length) - 1).to_bytes(length, "big"), left

    return _Part(write, read)


def _sequence_of(asn1: Any) -> _Part:
    count = _count(asn1)
    item = _part(asn1._cont)

    def write(values: list[Any], bits: int) -> int:
        bits = count.write(len(values), bits)
        for value in values:
            bits = item.write(value, bits)
        return bits

    def read(bits: int, left: int) -> tuple[list[Any], int]:
        length, left = count.read(bits, left)
        values = []
        for _ in range(length):
            value, left = item.read(bits, left)
            values.append(value)
        return values, left

    return _Part(write, read)


def _sequence(asn1: Any) -> _Part:
    """A zero if it can be extended, a bit for each optional member, the members.

    A member that has its default value is left out.
    """
    defaults = {name: part._def for name, part in _root(asn1) if part._def is not None}
    members = [(name, bool(part._opt) or name in defaults, *_part(part)) for name, part in _root(asn1)]
    optional = [name for name, is_optional, _, _ in members if is_optional]
    preamble = len(optional) + (asn1._ext is not None)

    def write(value: dict[str, Any], bits: int) -> int:
        if defaults:
            value = {name: part for name, part in value.items() if part != defaults.get(name)}
        present = 0
        for name in optional:
            present = present << 1 | (name in value)
        bits = bits << preamble | present
        written = 0
        for name, is_optional, write_member, _ in members:
            if not is_optional or name in value:
                bits = write_member(value[name], bits)
                written += 1
        if written != len(value):
            raise NotPlain
        return bits

    def read(bits: int, left: int) -> tuple[dict[str, Any], int]:
        left -= preamble
        present = bits >> left & (1 << preamble) - 1
        if present >> len(optional):
            raise NotPlain
        value, flag = {}, 1 << len(optional)
        for name, is_optional, _, read_member in members:
            if is_optional:
                flag >>= 1
                if not present & flag:
                    if name in defaults:
                        value[name] = defaults[name]
                    continue
            value[name], left = read_member(bits, left)
        return value, left

    return _Part(write, read)


def _choice(asn1: Any) -> _Part:
    alternatives = [(name, _part(part)) for name, part in _root(asn1)]
    place = {name: index for index, (name, _) in enumerate(alternatives)}
    index = _number(0, len(alternatives) - 1, asn1._ext is not None)

    def write(value: tuple[str, Any], bits: int) -> int:
        name, content = value
        chosen = place[name]
        return alternatives[chosen][1].write(content, index.write(chosen, bits))

    def read(bits: int, left: int) -> tuple[tuple[str, Any], int]:
        chosen, left = index.read(bits, left)
        name, part = alternatives[chosen]
        content, left = part.read(bits, left)
        return (name, content), left

    return _Part(write, read)


def _root(asn1: Any) -> list[tuple[str, Any]]:
    """The members or alternatives of the first release, in the order of the encoding."""
    return [(name, asn1._cont[name]) for name in asn1._root]


_PARTS: dict[str, Callable[[Any], _Part]] = {
    "INTEGER": _integer,
    "ENUMERATED": _enumerated,
    "BOOLEAN": _boolean,
    "BIT STRING": _bit_string,
    "OCTET STRING": _octet_string,
    "SEQUENCE": _sequence,
    "SEQUENCE OF": _sequence_of,
    "CHOICE": _choice,
}
