"""A sensor log in the form of Argoverse 2, written as its authors describe the files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import feather

START_NS = 315_969_904_359_876_000
STEP_NS = 100_000_000
SWEEPS = 4
CATEGORIES = ("REGULAR_VEHICLE", "BICYCLE", "BICYCLIST", "BOX_TRUCK", "SIGN")

Table = dict[str, Any]


def stamps() -> list[int]:
    return [START_NS + k * STEP_NS for k in range(SWEEPS)]


def quaternions(yaws: list[float]) -> Table:
    """Rotations about z."""
    return {
        "qw": [math.cos(yaw / 2) for yaw in yaws],
        "qx": [0.0] * len(yaws),
        "qy": [0.0] * len(yaws),
        "qz": [math.sin(yaw / 2) for yaw in yaws],
    }


def sweep(seed: int, count: int = 500) -> Table:
    """The columns of a sweep, with their types."""
    rng = np.random.default_rng(seed)
    return {
        "x": rng.uniform(-60, 60, count).astype(np.float16),
        "y": rng.uniform(-60, 60, count).astype(np.float16),
        "z": rng.uniform(-0.4, 3, count).astype(np.float16),
        "intensity": rng.integers(0, 256, count).astype(np.uint8),
        "laser_number": rng.integers(0, 64, count).astype(np.uint8),
        "offset_ns": rng.integers(0, STEP_NS, count).astype(np.int32),
    }


def tables_of() -> dict[str, Table]:
    """The tables of a log by their path."""
    poses = [*stamps(), START_NS + 12_345]  # of another sensor, too
    mounts = ("up_lidar", "down_lidar", "ring_front_center")
    rows = [(stamp, k) for stamp in stamps() for k in range(len(CATEGORIES))]
    return {
        "city_SE3_egovehicle": {
            "timestamp_ns": poses,
            **quaternions([0.2 + 0.01 * k for k in range(len(poses))]),
            "tx_m": [1468.8 + 1.1 * k for k in range(SWEEPS)] + [1468.8],
            "ty_m": [211.5] * len(poses),
            "tz_m": [13.5] * len(poses),
        },
        "calibration/egovehicle_SE3_sensor": {
            "sensor_name": mounts,
            **quaternions([0.01, 0.02, -1.5]),
            "tx_m": [1.35, 1.35, 1.6],
            "ty_m": [0.0, 0.0, 0.0],
            "tz_m": [1.64, 1.56, 1.4],
        },
        "calibration/intrinsics": {
            "sensor_name": ["ring_front_center"],
            **{name: [value] for name, value in zip(("fx_px", "fy_px"), (1687.5, 1687.5), strict=True)},
            "cx_px": [777.0],
            "cy_px": [1020.0],
            "k1": [-0.25],
            "k2": [-0.1],
            "k3": [0.2],
            "height_px": [2048],
            "width_px": [1550],
        },
        "annotations": {
            "timestamp_ns": [stamp for stamp, _ in rows],
            "track_uuid": [f"track-{k}" for _, k in rows],
            "category": [CATEGORIES[k] for _, k in rows],
            "length_m": [4.5] * len(rows),
            "width_m": [1.9] * len(rows),
            "height_m": [1.6] * len(rows),
            **quaternions([0.3 * k - 1 for _, k in rows]),
            "tx_m": [10.25 + k for _, k in rows],
            "ty_m": [-3.5] * len(rows),
            "tz_m": [0.6] * len(rows),
            "num_interior_pts": [7 * k for _, k in rows],
        },
    }


def write_av2(log: Path, tables: dict[str, Table] | None = None) -> Path:
    """Write a log; returns its folder."""
    for name, table in (tables_of() if tables is None else tables).items():
        write_table(log / f"{name}.feather", table)
    for k, stamp in enumerate(stamps()):
        write_table(log / "sensors" / "lidar" / f"{stamp}.feather", sweep(k))
    return log


def write_table(file: Path, table: Table) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(table), file)
