"""KITTI's classes and ours."""

from __future__ import annotations

from collections.abc import Mapping

KITTI_NAMES: Mapping[str, str] = {
    "car": "Car",
    "truck": "Truck",
    "cyclist": "Cyclist",
    "pedestrian": "Pedestrian",
}
"""Our classes as KITTI writes them."""
