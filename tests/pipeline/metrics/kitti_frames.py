"""Synthetic frames for KITTI's rules; made of uniform draws alone, so that they stay the same."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.kitti_objects import DONT_CARE, KittiObjects

T = TypeVar("T")

NAMES = ("Car", "Van", "Pedestrian", "Person_sitting", "Cyclist", "Truck", DONT_CARE)
SIZES_HWL_M = {
    "Car": (1.5, 1.7, 4.0),
    "Van": (2.1, 1.9, 5.0),
    "Pedestrian": (1.7, 0.6, 0.8),
    "Person_sitting": (1.2, 0.6, 0.8),
    "Cyclist": (1.7, 0.6, 1.8),
    "Truck": (3.0, 2.5, 9.0),
}
HEIGHTS_PX = (25.0, 40.0, 20.0, 33.0, 55.0, 80.0)
TRUNCATIONS = (0.0, 0.0, 0.0, 0.15, 0.3, 0.5, 0.7)
OCCLUSIONS = (0.0, 0.0, 1.0, 2.0, 3.0)
JITTERS = (0.0, 0.03, 0.08, 0.2)


def synthetic_frames(count: int, seed: int) -> tuple[list[KittiObjects], list[KittiObjects]]:
    """Objects and detections of so many frames; some frames have none of one or of both."""
    draw = np.random.default_rng(seed)
    frames = [_frame(draw) for _ in range(count)]
    return [truth for truth, _ in frames], [found for _, found in frames]


def _of(draw: np.random.Generator, choices: tuple[T, ...]) -> T:
    return choices[int(draw.random() * len(choices))]


def _frame(draw: np.random.Generator) -> tuple[KittiObjects, KittiObjects]:
    truth, found = [], []
    for _ in range(int(draw.random() * 11)):
        name = _of(draw, NAMES)
        left, top, height = 1000 * draw.random(), 100 + 100 * draw.random(), _of(draw, HEIGHTS_PX)
        bbox = np.array([left, top, left + 20 + 100 * draw.random(), top + height])
        if name == DONT_CARE:
            bbox[2:] += 60.0
            truth.append((name, bbox, -1.0, -1.0, np.array([-1.0] * 3 + [-1000.0] * 3 + [-10.0]), -10.0))
            if draw.random() < 0.6:  # a detection in the region
                inside = bbox + np.array([5.0, 5.0, -30.0, -10.0])
                found.append((_of(draw, NAMES[:5:2]), inside, _box("Car", draw), 0.0, draw.random()))
            continue
        box, alpha_rad = _box(name, draw), 6.0 * draw.random() - 3.0
        truth.append((name, bbox, _of(draw, TRUNCATIONS), _of(draw, OCCLUSIONS), box, alpha_rad))
        while draw.random() < 0.55:
            jitter = _of(draw, JITTERS)
            seen = name if draw.random() < 0.85 else _of(draw, NAMES[:5])
            moved = box + jitter * (draw.random(7) - 0.5) * np.array([1.0, 1.0, 3.0, 3.0, 1.0, 3.0, 1.0])
            about = bbox + jitter * height * (draw.random(4) - 0.5)
            score = round(0.4 + 0.6 * draw.random(), 1 if draw.random() < 0.3 else 6)  # some are equal
            found.append((seen, about, moved, alpha_rad + draw.random() - 0.5, score))
    if draw.random() < 0.5:  # finds nothing
        bbox = np.array([0.0, 0.0, 40.0, _of(draw, HEIGHTS_PX)])
        found.append((_of(draw, NAMES[:5:2]), bbox, _box("Car", draw), 1.0, draw.random()))
    return _objects(truth), _detections(found)


def _box(name: str, draw: np.random.Generator) -> npt.NDArray[np.float64]:
    place = (40 * draw.random() - 20, 1.0 + draw.random(), 5 + 50 * draw.random(), 6 * draw.random() - 3)
    return np.array([*SIZES_HWL_M[name], *place])


def _objects(rows: list[Any]) -> KittiObjects:
    names, bbox, truncated, occluded, boxes, alpha = zip(*rows, strict=True) if rows else ((),) * 6
    return KittiObjects(names, *map(np.array, (bbox, truncated, occluded, boxes, alpha)))


def _detections(rows: list[Any]) -> KittiObjects:
    names, bbox, boxes, alpha, scores = zip(*rows, strict=True) if rows else ((),) * 5
    unknown = np.full(len(names), -1.0)
    return KittiObjects(
        names, np.array(bbox), unknown, unknown, np.array(boxes), np.array(alpha), np.array(scores)
    )
