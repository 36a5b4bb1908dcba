"""A nuScenes data set of two scenes, written as its authors describe the tables."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

Tables = dict[str, list[dict[str, Any]]]

STEP_US = 500_000
START_US = 1_532_402_927_647_951
SAMPLES = 4


def quaternion(yaw: float = 0.0, pitch: float = 0.0) -> list[float]:
    """A yaw after a pitch as w, x, y, z."""
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    return [cy * cp, -sy * sp, cy * sp, sy * cp]


def points(seed: int, count: int = 600) -> np.ndarray:
    """x, y, z, intensity 0 to 255, ring."""
    rng = np.random.default_rng(seed)
    table = np.empty((count, 5), np.float32)
    table[:, :2] = rng.uniform(-40, 40, (count, 2))
    table[:, 2] = -1.84
    table[:, 3], table[:, 4] = rng.integers(0, 256, count), rng.integers(0, 32, count)
    return table


def tables_of(scenes: tuple[str, ...] = ("scene-0061", "scene-0103")) -> Tables:
    """The tables of these scenes, each of `SAMPLES` key frames and sweeps in between."""
    tables: Tables = {
        name: [] for name in ("sample", "sample_data", "sample_annotation", "ego_pose", "instance")
    }
    tables["category"] = [
        {"token": f"c{k}", "name": name, "description": ""}
        for k, name in enumerate(("vehicle.car", "vehicle.bicycle", "vehicle.trailer", "vehicle.bus.rigid"))
    ]
    tables["attribute"] = [
        {"token": "with", "name": "cycle.with_rider", "description": ""},
        {"token": "without", "name": "cycle.without_rider", "description": ""},
        {"token": "parked", "name": "vehicle.parked", "description": ""},
    ]
    tables["sensor"] = [
        {"token": "top", "channel": "LIDAR_TOP", "modality": "lidar"},
        {"token": "front", "channel": "CAM_FRONT", "modality": "camera"},
    ]
    tables["calibrated_sensor"] = [
        {
            "token": f"mount-{sensor}",
            "sensor_token": sensor,
            "translation": [0.94, 0.0, 1.84],
            "rotation": quaternion(-math.pi / 2, 0.01),
            "camera_intrinsic": [],
        }
        for sensor in ("top", "front")
    ]
    tables["log"] = [
        {"token": "log", "logfile": "", "vehicle": "n015", "date_captured": "2018-07-24", "location": "here"}
    ]
    tables["map"] = [
        {"token": "map", "category": "semantic_prior", "filename": "maps/a.png", "log_tokens": ["log"]}
    ]
    tables["visibility"] = [{"token": "4", "level": "v80-100", "description": ""}]
    tables["scene"] = [
        {
            "token": f"t-{name}",
            "name": name,
            "log_token": "log",
            "nbr_samples": SAMPLES,
            "first_sample_token": f"{name}-s0",
            "last_sample_token": f"{name}-s{SAMPLES - 1}",
            "description": "",
        }
        for name in scenes
    ]
    for number, name in enumerate(scenes):
        _add_scene(tables, name, START_US + number * 60_000_000)
    return tables


def _add_scene(tables: Tables, name: str, start_us: int) -> None:
    for k in range(SAMPLES):
        stamp, sample = start_us + k * STEP_US, f"{name}-s{k}"
        tables["sample"].append(
            {
                "token": sample,
                "timestamp": stamp,
                "scene_token": f"t-{name}",
                "prev": f"{name}-s{k - 1}" if k else "",
                "next": f"{name}-s{k + 1}" if k < SAMPLES - 1 else "",
            }
        )
        for sensor, is_key in (("top", True), ("front", True), ("top", False)):
            token = f"{name}-{sensor}-{k}-{is_key}"
            folder = f"{'samples' if is_key else 'sweeps'}/{'LIDAR_TOP' if sensor == 'top' else 'CAM_FRONT'}"
            tables["ego_pose"].append(
                {
                    "token": f"pose-{token}",
                    "timestamp": stamp,
                    "translation": [411.3 + 4.0 * k, 1180.9 + 0.3 * k, 0.0],
                    "rotation": quaternion(0.3 + 0.01 * k, 0.004),
                }
            )
            tables["sample_data"].append(
                {
                    "token": token,
                    "sample_token": sample,
                    "ego_pose_token": f"pose-{token}",
                    "calibrated_sensor_token": f"mount-{sensor}",
                    "timestamp": stamp,
                    "fileformat": "pcd",
                    "is_key_frame": is_key,
                    "height": 0,
                    "width": 0,
                    "filename": f"{folder}/{name}__{k}.pcd.bin",
                    "prev": "",
                    "next": "",
                }
            )
    _add_objects(tables, name)


def _add_objects(tables: Tables, name: str) -> None:
    """A car that moves and is out of sight once, cycles with and without a rider, a trailer, a parked bus."""
    kinds = [("c0", []), ("c1", ["with"]), ("c1", ["without"]), ("c2", []), ("c3", ["parked"])]
    for row, (category, attributes) in enumerate(kinds):
        instance, seen = f"{name}-i{row}", [k for k in range(SAMPLES) if not (row == 0 and k == 1)]
        tokens = [f"{instance}-{k}" for k in seen]
        tables["instance"].append(
            {
                "token": instance,
                "category_token": category,
                "nbr_annotations": len(seen),
                "first_annotation_token": tokens[0],
                "last_annotation_token": tokens[-1],
            }
        )
        for place, k in enumerate(seen):
            tables["sample_annotation"].append(
                {
                    "token": tokens[place],
                    "sample_token": f"{name}-s{k}",
                    "instance_token": instance,
                    "visibility_token": "4",
                    "attribute_tokens": attributes,
                    "translation": [420.123 + 10 * row + (2.0 * k if row < 2 else 0), 1190.5 - row, 0.9],
                    "size": [1.9, 4.6, 1.7],
                    "rotation": quaternion(0.5 * row - 1.2),
                    "prev": tokens[place - 1] if place else "",
                    "next": tokens[place + 1] if place < len(seen) - 1 else "",
                    "num_lidar_pts": 10 * row + k,
                    "num_radar_pts": 0,
                }
            )


def write_nuscenes(folder: Path, tables: Tables | None = None, version: str = "v1.0-mini") -> Path:
    """Write a data set; returns its folder."""
    from PIL import Image

    tables = tables_of() if tables is None else tables
    (folder / version).mkdir(parents=True)
    for name, records in tables.items():
        (folder / version / f"{name}.json").write_text(json.dumps(records, indent=0))
    for number, record in enumerate(tables["sample_data"]):
        if "LIDAR_TOP" in record["filename"]:
            file = folder / record["filename"]
            file.parent.mkdir(parents=True, exist_ok=True)
            points(number).tofile(file)
    (folder / "maps").mkdir(exist_ok=True)
    Image.new("L", (1, 1)).save(folder / "maps" / "a.png")
    return folder
