"""Writes clouds as other programs do, for the tests of their readers."""

from __future__ import annotations

import struct

import numpy as np

POINTS = np.zeros(
    300, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("t", "<u4")]
)


def some_points(seed: int = 0, count: int = 300) -> np.ndarray:
    """Points of a LiDAR on the ground plane, with channel and time in nanoseconds."""
    rng = np.random.default_rng(seed)
    points = np.zeros(count, POINTS.dtype)
    points["x"], points["y"] = rng.uniform(-40, 40, count), rng.uniform(-30, 30, count)
    points["z"], points["intensity"] = rng.normal(-1.7, 0.1, count), rng.uniform(0, 1, count)
    points["ring"], points["t"] = rng.integers(0, 64, count), np.sort(rng.integers(0, 10**8, count))
    return points


def pcd(points: np.ndarray, form: str = "binary") -> bytes:
    """A PCD file of structured points."""
    names = points.dtype.names
    kinds = [points.dtype[name] for name in names]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\nSIZE {' '.join(str(kind.itemsize) for kind in kinds)}\n"
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}\nCOUNT {' '.join('1' for _ in names)}\n"
        f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {form}\n"
    ).encode()
    if form == "ascii":
        return header + "".join(" ".join(repr(v.item()) for v in row) + "\n" for row in points).encode()
    if form == "binary":
        return header + points.tobytes()
    columns = b"".join(np.ascontiguousarray(points[name]).tobytes() for name in names)
    packed = literal_lzf(columns)
    return header + struct.pack("<II", len(packed), len(columns)) + packed


def literal_lzf(data: bytes) -> bytes:
    """LZF without any copy: runs of up to 32 literal bytes."""
    runs = (data[place : place + 32] for place in range(0, len(data), 32))
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


PLY_NAMES = {"f4": "float", "u2": "ushort", "u4": "uint", "f8": "double"}


def ply(points: np.ndarray, order: str = "<") -> bytes:
    """A PLY file; order: of bytes, "" for text."""
    form = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    names = points.dtype.names
    lines = [f"property {PLY_NAMES[points.dtype[name].str[1:]]} {name}" for name in names]
    header = ["ply", f"format {form} 1.0", "comment made by a test", f"element vertex {len(points)}", *lines]
    head = "\n".join([*header, "end_header", ""]).encode()
    if not order:
        return head + "".join(" ".join(repr(v.item()) for v in row) + "\n" for row in points).encode()
    return head + points.astype(points.dtype.newbyteorder(order)).tobytes()
