"""Reads clouds of the Stanford format PLY: text, and binary of either byte order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.import_.point_fields import MOST_POINTS, Array, read_exactly

_MOST_LINES, _LONGEST_LINE, _MOST_PROPERTIES = 1000, 4096, 256
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    name: str
    count: int
    properties: dict[str, str] = field(default_factory=dict)
    has_list: bool = False

    def point_dtype(self, order: str) -> np.dtype[np.void]:
        return np.dtype([(name, (order or "<") + code) for name, code in self.properties.items()])


def read_ply(file: Path) -> Mapping[str, Array]:
    """The properties of a PLY file's vertices by name, each (N,). Raises AdvpipeError."""
    with file.open("rb") as stream:
        order, elements = _read_header(stream)
        for element in elements:
            if element.has_list:
                raise AdvpipeError(f"its {element.name} has a list, so it is not a cloud of points")
            points = _read_element(stream, element, order)
            if element.name == "vertex":
                return {name: points[name] for name in element.properties}
    raise AdvpipeError("it has no vertices")


def _read_header(stream: BinaryIO) -> tuple[str, list[_Element]]:
    """The byte order, and the elements up to the vertices."""
    if stream.readline(_LONGEST_LINE).strip() != b"ply":
        raise AdvpipeError("it does not begin with the line `ply`, so it is not a PLY file")
    order, elements = None, list[_Element]()
    for _ in range(_MOST_LINES):
        words = stream.readline(_LONGEST_LINE).decode("ascii", "replace").split()
        match words:
            case ["end_header"]:
                if order is None:
                    break
                until = (
                    [element.name for element in elements].index("vertex") + 1 if _has_vertex(elements) else 0
                )
                return order, elements[:until]
            case ["format", name, *_]:
                order = _ORDERS.get(name)
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 20:
                if int(count) > MOST_POINTS:
                    raise AdvpipeError(
                        f"it declares {int(count):,} points; a cloud has at most {MOST_POINTS:,}"
                    )
                elements.append(_Element(name, int(count)))
            case ["property", "list", *_] if elements:
                elements[-1].has_list = True
            case ["property", code, name] if elements and code in _TYPES:
                elements[-1].properties[name] = _TYPES[code]
                if len(elements[-1].properties) > _MOST_PROPERTIES:
                    break
            case [("comment" | "obj_info"), *_]:
                pass
            case _:
                break
    raise AdvpipeError("its PLY header is damaged, or of a kind that is not known")


def _has_vertex(elements: list[_Element]) -> bool:
    return any(element.name == "vertex" for element in elements)


def _read_element(stream: BinaryIO, element: _Element, order: str) -> Array:
    point_dtype = element.point_dtype(order)
    if order:
        data = read_exactly(stream, element.count * point_dtype.itemsize)
        return np.frombuffer(data, point_dtype) if point_dtype.itemsize else np.zeros(0, point_dtype)
    if not element.count:
        return np.zeros(0, point_dtype)
    try:
        table = np.loadtxt(stream, np.float64, ndmin=2, max_rows=element.count, encoding="ascii")
    except (ValueError, UnicodeDecodeError):
        raise AdvpipeError("its points are not lines of numbers, one for each property") from None
    if table.shape != (element.count, len(element.properties)):
        raise AdvpipeError(
            f"it holds {table.shape[0]} points of {table.shape[1]} values, but its header declares "
            f"{element.count} of {len(element.properties)}; it may be truncated"
        )
    points = np.zeros(element.count, point_dtype)
    with np.errstate(all="ignore"):
        for place, name in enumerate(element.properties):
            points[name] = table[:, place]
    return points
