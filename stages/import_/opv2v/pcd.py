"""Clouds of OPV2V: PCD files, in text or binary, whose colour's red channel is the intensity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud

_LONGEST_HEADER = 4096
_NUMBER_TYPES = {
    "F4": "<f4",
    "F8": "<f8",
    "U1": "u1",
    "U2": "<u2",
    "U4": "<u4",
    "I1": "i1",
    "I2": "<i2",
    "I4": "<i4",
}
_STRONGEST = 255


def read_opv2v_cloud(file: Path) -> Cloud:
    """The cloud (N,), in right-handed coordinates; intensities are 0 to 1.

    Coordinates change the sign of y only; a field `intensity` is taken as it is. Raises AdvpipeError for a
    file that is truncated or in another form.
    """
    try:
        data = file.read_bytes()
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    try:
        points = _points(data)
    except (ValueError, KeyError) as error:
        raise AdvpipeError(f"{file}: not a PCD file as OPV2V has them: {error}") from None
    names = points.dtype.names or ()
    cloud = np.zeros(len(points), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = points["x"], -points["y"].astype(np.float32), points["z"]
    if "intensity" in names:
        cloud["intensity"] = points["intensity"]
    elif "rgb" in names:
        packed = np.ascontiguousarray(points["rgb"])
        colour = packed.view(np.uint32) if packed.dtype == np.float32 else packed.astype(np.uint32)
        cloud["intensity"] = ((colour >> 16) & 0xFF).astype(np.float32) / np.float32(_STRONGEST)
    return cloud


def _points(data: bytes) -> npt.NDArray[np.void]:
    header, start = _header(data)
    names, sizes, kinds = header["FIELDS"], header["SIZE"], header["TYPE"]
    if not set("xyz") <= set(names):
        raise ValueError(f"its fields are {' '.join(names)}")
    if any(count != "1" for count in header.get("COUNT", [])):
        raise ValueError("a field has several numbers a point")
    if len(set(names)) < len(names):
        raise ValueError("a field is named twice")
    formats = [_NUMBER_TYPES[kind + size] for kind, size in zip(kinds, sizes, strict=True)]
    dtype = np.dtype(list(zip(names, formats, strict=True)))
    count, how = int(header["POINTS"][0]), header["DATA"][0]
    if count < 0:
        raise ValueError("it declares a negative number of points")
    if how == "binary":
        if len(data) - start < count * dtype.itemsize:
            raise ValueError(
                f"{count} points are declared, but {(len(data) - start) // dtype.itemsize} present"
            )
        return np.frombuffer(data, dtype, count, start)
    if how == "ascii":
        values = data[start:].split()
        if len(values) != count * len(names):
            raise ValueError(f"{count} points are declared, but {len(values) // len(names)} present")
        points = np.zeros(count, dtype)
        for place, name in enumerate(names):
            points[name] = [float(value) for value in values[place :: len(names)]]
        return points
    raise ValueError(f"its data are {how}; write them as ascii or binary")


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    """The header's lines by their first word, and where the data begin."""
    found: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in found:
        end = data.find(b"\n", start, _LONGEST_HEADER)
        if end < 0:
            raise ValueError("its header has no end")
        words = data[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            found[words[0]] = words[1:]
    for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA"):
        if not found.get(key):
            raise ValueError(f"its header has no {key}")
    return found, start
