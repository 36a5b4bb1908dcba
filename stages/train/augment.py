"""Random changes of a training frame that keep its labels correct."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.geometry.transforms import Float64, se3, wrap_angle
from advpipe.stages.train.config import Augmentation
from advpipe.stages.train.frames import FrameStore, TrainingFrame, transformed
from advpipe.stages.train.mounting import remount

Rng = np.random.Generator

AROUND_M, LEAST_POINTS, GROUND_PERCENTILE, MOST_RISE_M = 1.5, 5, 20, 1.0
"""The ground under a pasted object: this percentile of the heights of the points in its box, so much longer
and wider, if there are so many; the object is raised or lowered by at most so much."""

MOST_VOXEL_M = 0.5
"""A pillar, as high as the whole range, shifts clouds no further than a voxel of this size: otherwise they
leave the range."""


class ObjectBank:
    """Objects with enough points, by class, to paste into other frames ("ground-truth sampling", Yan
    et al. 2018, section 3.4.1)."""

    def __init__(self, store: FrameStore, min_points: int) -> None:
        self.store = store
        enough = store.counts >= min_points
        self.by_class = {
            sensor: [
                np.flatnonzero(enough & (store.labels == label) & (store.sensors == sensor))
                for label in range(4)
            ]
            for sensor in np.unique(store.sensors).tolist()
        }

    def paste(self, frame: TrainingFrame, wanted: tuple[int, ...], rng: Rng) -> TrainingFrame:
        """The frame with up to `wanted` objects of each class, each turned about the sensor.

        An object comes from a frame of the same sensor and keeps its distance, so that its points stay as
        dense as they were measured; it stands on the ground that it is put on. It is left out if it would
        touch another object or anything that stands on the ground.
        """
        chosen = [
            (i, label)
            for label, count in enumerate(wanted)
            if len(self.by_class[frame.sensor][label])
            for i in rng.choice(self.by_class[frame.sensor][label], size=count).tolist()
        ]
        if not chosen:
            return frame
        turned = [_turned(*self.store.object(i), rng) for i, _ in chosen]
        points, added = _on_ground(frame, [each for each, _ in turned], np.array([box for _, box in turned]))
        free = np.zeros(len(added), dtype=bool)
        scene = points_in_boxes(frame.points, added)
        taken = frame.boxes
        for k, box in enumerate(added):
            standing = (frame.points[scene[k], 2] > box[2] - box[5] / 2 + 0.4).sum()
            gap = np.hypot(*(taken[:, :2] - box[:2]).T)
            reach = (np.hypot(taken[:, 3], taken[:, 4]) + np.hypot(box[3], box[4])) / 2
            free[k] = standing < 3 and (gap > reach).all()
            if free[k]:
                taken = np.concatenate([taken, box[None]])
        kept = np.ones(len(frame.points), dtype=bool)
        for row in np.flatnonzero(free):
            kept[scene[row]] = False
        labels = np.array([label for _, label in chosen])[free]
        counts = np.array([len(p) for p in points])[free]
        new_points = [p for p, ok in zip(points, free, strict=True) if ok]
        return replace(
            frame,
            points=np.concatenate([frame.points.take(np.flatnonzero(kept), axis=0), *new_points]),
            boxes=taken,
            labels=np.concatenate([frame.labels, labels]),
            counts=np.concatenate([frame.counts, counts]),
        )


def _on_ground(
    frame: TrainingFrame, points: list[npt.NDArray[np.float32]], boxes: Float64
) -> tuple[list[npt.NDArray[np.float32]], Float64]:
    """The objects, each raised or lowered to the ground about its place, where the frame has points of it."""
    about = boxes + np.array([0.0, 0.0, 0.0, AROUND_M, AROUND_M, 2 * MOST_RISE_M, 0.0])
    for k, rows in enumerate(points_in_boxes(frame.points, about)):
        if len(rows) < LEAST_POINTS:
            continue
        rise_m = np.percentile(frame.points[rows, 2], GROUND_PERCENTILE) - (boxes[k, 2] - boxes[k, 5] / 2)
        if abs(rise_m) <= MOST_RISE_M:
            points[k][:, 2] += np.float32(rise_m)
            boxes[k, 2] += rise_m
    return points, boxes


def _turned(
    points: npt.NDArray[np.float32], box: npt.NDArray[np.float64], rng: Rng
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float64]]:
    """An object rotated about the sensor by a random angle."""
    yaw = rng.uniform(-np.pi, np.pi)
    turned = TrainingFrame(points, box[None], np.zeros(1, np.int64), np.zeros(1, np.int64))
    turned = rotate(turned, yaw)
    return turned.points, turned.boxes[0]


def rotate(frame: TrainingFrame, yaw_rad: float) -> TrainingFrame:
    """The frame turned about the sensor's z axis."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return _transformed(frame, np.array([[c, -s], [s, c]]), yaw_rad, 1)


def flip(frame: TrainingFrame) -> TrainingFrame:
    """The frame's mirror image, left for right."""
    return _transformed(frame, np.diag([1.0, -1.0]), 0.0, -1)


def _transformed(frame: TrainingFrame, matrix: Float64, yaw_rad: float, sign: int) -> TrainingFrame:
    """The frame, its ground rotated or reflected by a matrix (2, 2); a heading h becomes sign h + yaw_rad."""
    new_SE3_old = np.eye(4)
    new_SE3_old[:2, :2] = matrix

    def turned(boxes: Float64) -> Float64:
        new = boxes.copy()
        new[:, :2] = boxes[:, :2] @ matrix.T
        new[:, 6] = wrap_angle(sign * boxes[:, 6] + yaw_rad)
        return new

    return replace(
        frame,
        points=transformed(frame.points, new_SE3_old),
        boxes=turned(frame.boxes),
        ignored=turned(frame.ignored),
        coverage=frame.coverage.transformed(new_SE3_old),
    )


def augment(
    frame: TrainingFrame,
    config: Augmentation,
    voxel_size_m: tuple[float, float, float],
    rng: Rng,
    bank: ObjectBank | None = None,
) -> TrainingFrame:
    """Paste, drop, flip, rotate, remount, scale, shift, jitter, in this order."""
    if bank is not None and any(config.paste):
        frame = bank.paste(frame, config.paste, rng)
    keep = 1 - rng.uniform(0, config.drop)
    points = frame.points
    if config.drop:
        points = points.take(np.flatnonzero(rng.random(len(points), dtype=np.float32) < keep), axis=0)
    # Objects that lose their points are ignored in training.
    frame = replace(frame, points=points, counts=(frame.counts * keep).astype(np.int64))
    if config.flip and rng.random() < 0.5:
        frame = flip(frame)
    frame = rotate(frame, rng.uniform(-config.yaw_rad, config.yaw_rad))
    frame = remount(frame, config, rng)
    scale = 1 + rng.uniform(-config.scale, config.scale)
    shift = rng.uniform(-config.shift_voxels, config.shift_voxels, 3) * np.minimum(voxel_size_m, MOST_VOXEL_M)
    moved = se3(scale * np.eye(3), shift)
    points = transformed(frame.points, moved)
    for boxes in (frame.boxes, frame.ignored):
        boxes[:, :6] *= scale
        boxes[:, :3] += shift
    frame = replace(frame, points=points, coverage=frame.coverage.transformed(moved))
    if config.jitter_m:
        sigma = np.float32(rng.uniform(0, config.jitter_m))
        points[:, :3] += sigma * rng.standard_normal((len(points), 3), dtype=np.float32)
    gain = np.float32(1 + rng.uniform(-config.intensity, config.intensity))
    points[:, 3] = np.clip(points[:, 3] * gain, 0, 1)
    return frame
