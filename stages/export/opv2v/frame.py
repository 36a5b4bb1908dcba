"""A cloud as OPV2V's PCD file, and what is around it as its YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.carla import carla_from_se3
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.export.opv2v.ids import Numbers
from advpipe.stages.export.recorded import RecordedFrame

STRONGEST = 255

_HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z rgb
SIZE 4 4 4 4
TYPE F F F F
COUNT 1 1 1 1
WIDTH {count}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {count}
DATA binary
"""


KINDS = {"car": "Car", "truck": "Truck", "cyclist": "Cyclist"}
"""`obj_type` of the classes that are vehicles; OPV2V itself tells none apart."""


def write_frame(stem: Path, frame: RecordedFrame, numbers: Numbers) -> int:
    """Write `<stem>.pcd` and `<stem>.yaml`, in CARLA's left-handed coordinates; returns how many vehicles.

    numbers: by which objects are known.
    """
    with stem.with_suffix(".pcd").open("wb") as file:
        points = _points(frame.cloud)
        file.write(_HEADER.format(count=len(points)).encode())
        file.write(points.tobytes())
    boxes = frame.boxes
    vehicles = {
        numbers.of(name or f"unnamed.{row}"): {
            **_vehicle(boxes.geometry[row], boxes.velocity_mps[row]),
            "obj_type": KINDS[CLASSES[label]],
        }
        for row, (name, label) in enumerate(zip(boxes.ids, boxes.labels, strict=True))
        if CLASSES[label] in KINDS
    }
    document = {
        "lidar_pose": carla_from_se3(frame.map_SE3_lidar),
        "true_ego_pos": carla_from_se3(frame.map_SE3_base),
        "vehicles": vehicles,
    }
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    stem.with_suffix(".yaml").write_text(yaml.dump(document, Dumper=dumper), encoding="utf-8")
    return len(vehicles)


def _points(cloud: Cloud) -> npt.NDArray[np.void]:
    """Mirrored points; the red channel of their colour is the intensity, as Open3D reads it."""
    points = np.zeros(len(cloud), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
    points["x"], points["y"], points["z"] = cloud["x"], -cloud["y"], cloud["z"]
    intensity = np.nan_to_num(np.clip(cloud["intensity"], 0, 1))
    points["rgb"] = np.round(intensity * STRONGEST).astype(np.uint32) << 16
    return points


def _vehicle(box: Float64, velocity_mps: Float64) -> dict[str, Any]:
    """A box as OpenCDA writes it: from the ground below its centre, with half sizes and km/h."""
    x_m, y_m, z_m, length_m, width_m, height_m, yaw_rad = map(float, box)
    speed_mps = float(np.linalg.norm(velocity_mps))
    vehicle = {
        "angle": [0.0, float(-np.degrees(yaw_rad)), 0.0],
        "center": [0.0, 0.0, height_m / 2],
        "extent": [length_m / 2, width_m / 2, height_m / 2],
        "location": [x_m, -y_m, z_m - height_m / 2],
    }
    return {**vehicle, "speed": speed_mps * 3.6} if np.isfinite(speed_mps) else vehicle
