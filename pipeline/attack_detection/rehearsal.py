"""What a defender rehearses on clean clouds: spoofed objects, and shadows of real ones that are invalidated.

The limits of published detectors are fitted to attacks as well as to clean clouds. A defender knows no attack
that is to come, but can spoof: as Sun et al. (USENIX Security 2020, sections 4 and 6) do, the few points of a
real object are moved to where an object right ahead would brake the vehicle. Nothing is drawn at random.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import MIN_POINTS, points_in_boxes
from advpipe.pipeline.geometry.iou import iou_bev

Float64 = npt.NDArray[np.float64]

MOST_SPOOFED_POINTS = 200
"""What the spoofers of 2020 can inject into a cloud."""

AHEAD_M = (5.0, 8.0)
"""Front-near, where the papers' spoofed objects stand."""

MOST_OBJECTS = 8
"""Spoofed ones for each clean cloud."""


@dataclass(frozen=True)
class SpoofedObject:
    """A box (7,) that a detector would report, and a cloud (N, 3) with its points and nothing else of it."""

    box: Float64
    points: Float64


def spoofed_objects(points: Float64, boxes: Float64) -> Iterator[SpoofedObject]:
    """One for each detected box (M, 7), of the first `MOST_OBJECTS`, in a clean cloud (N, 3).

    At most `MOST_SPOOFED_POINTS` of its returns are turned about the sensor to straight ahead, and shifted to
    `AHEAD_M`, with the box. Boxes of few returns are left out, and those that would stand in another box.
    """
    inside = points_in_boxes(points, boxes)
    usable = [number for number, members in enumerate(inside) if len(members) >= MIN_POINTS][:MOST_OBJECTS]
    for number, ahead_m in zip(usable, np.linspace(*AHEAD_M, len(usable)), strict=True):
        box = boxes[number].copy()
        turned_rad = -np.arctan2(box[1], box[0])
        cos, sin = np.cos(turned_rad), np.sin(turned_rad)
        lidar_R_lidar = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        box[:3] = lidar_R_lidar @ box[:3]
        shift_m = np.array([ahead_m - box[0], 0.0, 0.0])
        box[0], box[6] = ahead_m, box[6] + turned_rad
        if iou_bev(box[None], boxes).any():
            continue
        members = inside[number]
        few = members[np.linspace(0, len(members) - 1, min(len(members), MOST_SPOOFED_POINTS)).astype(int)]
        yield SpoofedObject(box, np.concatenate([points, points[few] @ lidar_R_lidar.T + shift_m]))


def evenly(count: int, number: int) -> Float64:
    """Values (count, number) that fill the unit cube evenly: an additive recurrence (Roberts 2018, R_d)."""
    root = 2.0
    for _ in range(30):
        root = (1 + root) ** (1 / (number + 1))
    steps = root ** -np.arange(1, number + 1)
    values: Float64 = (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return values
