"""Random values of a compiled ASN.1 type, with the ends of ranges more often than chance has them."""

from __future__ import annotations

from random import Random
from typing import Any


def random_value(asn1: Any, rng: Random) -> Any:
    """A value of the first release, as pycrate takes it."""
    match asn1.TYPE:
        case "INTEGER":
            bounds = asn1._const_val.root[0]
            return rng.choice([bounds.lb, bounds.ub, rng.randint(bounds.lb, bounds.ub)])
        case "ENUMERATED":
            return rng.choice(list(asn1._root))
        case "BOOLEAN":
            return rng.random() < 0.5
        case "SEQUENCE":
            chosen = [name for name in asn1._root if not asn1._cont[name]._opt or rng.random() < 0.6]
            return {name: random_value(asn1._cont[name], rng) for name in chosen}
        case "CHOICE":
            name = rng.choice(list(asn1._root))
            return name, random_value(asn1._cont[name], rng)
    size = _size(asn1, rng)
    match asn1.TYPE:
        case "BIT STRING":
            return rng.getrandbits(size), size
        case "OCTET STRING":
            return rng.randbytes(size)
    return [random_value(asn1._cont, rng) for _ in range(size)]


def as_asn1tools_takes_it(asn1: Any, value: Any) -> Any:
    """The same value with bit strings as bytes."""
    match asn1.TYPE:
        case "BIT STRING":
            bits, size = value
            return (bits << -size % 8).to_bytes((size + 7) // 8, "big"), size
        case "SEQUENCE OF":
            return [as_asn1tools_takes_it(asn1._cont, each) for each in value]
        case "SEQUENCE":
            return {name: as_asn1tools_takes_it(asn1._cont[name], each) for name, each in value.items()}
        case "CHOICE":
            return value[0], as_asn1tools_takes_it(asn1._cont[value[0]], value[1])
    return value


def _size(asn1: Any, rng: Random) -> int:
    if asn1._const_sz is None:
        return rng.choice([0, 1, 5, 127, 128, 300])
    size = asn1._const_sz.root[0]
    low, high = (size, size) if isinstance(size, int) else (size.lb, size.ub)
    return rng.choice([low, min(high, low + 1), min(high, low + 3)])
