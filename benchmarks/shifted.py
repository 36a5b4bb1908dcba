"""How a detector does on clouds that are raised, lowered or tilted, beside the same clouds as recorded.

    python benchmarks/shifted.py DETECTOR BAG [BAG ...] [--frames ::5] [--level] [--device cuda]

For each condition and class: the boxes, the share of them that is found with a score from 0.3 (at a
bird's-eye IoU of 0.5, or 0.25 for people and two-wheelers), and 3D AP R40 at strict and at loose overlap.
Choices about the shipped detector are made on this.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, count_points
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.geometry.transforms import Float64, se3, se3_from_tilt, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU, average_precision, match_frame

LEAST_SCORE = 0.3


@dataclass(frozen=True)
class LabelledCloud:
    """A cloud and the boxes in its frame."""

    cloud: Cloud
    boxes: Boxes

    def seen_from(self, new_SE3_old: Float64) -> LabelledCloud:
        """The same in another frame of reference; boxes stay upright."""
        places = transform_points(new_SE3_old, xyz(self.cloud))
        cloud = self.cloud.copy()
        cloud["x"], cloud["y"], cloud["z"] = places.T
        geometry = self.boxes.geometry.copy()
        geometry[:, :3] = transform_points(new_SE3_old, geometry[:, :3])
        return LabelledCloud(cloud, replace(self.boxes, geometry=geometry))


def raised(height_m: float) -> Float64:
    """The frame of a sensor that is so much lower, in which all things are higher."""
    return se3(np.eye(3), (0.0, 0.0, height_m))


def tilted(tilt_deg: float, axis_deg: float) -> Float64:
    """The frame of a sensor that is tilted about a level axis."""
    return se3_from_tilt(np.deg2rad(tilt_deg), np.deg2rad(axis_deg))


CONDITIONS: Mapping[str, Float64] = {
    "as recorded": np.eye(4),
    "raised 0.2 m": raised(0.2),
    "raised 0.4 m": raised(0.4),
    "lowered 0.2 m": raised(-0.2),
    "lowered 0.4 m": raised(-0.4),
    "tilted 2° ahead": tilted(2.0, 90.0),
    "tilted 2° to the left": tilted(2.0, 0.0),
}


@dataclass(frozen=True)
class ClassFigures:
    """Of one class under one condition; shares of 1, NaN without boxes."""

    boxes: int
    recall: float
    strict_ap: float
    loose_ap: float


def figures(
    frames: Sequence[LabelledCloud], found: Sequence[Detections], detector: ObjectDetector
) -> dict[str, ClassFigures]:
    """The figures of each class of the detector over frames and what it found in them."""
    out = {}
    for name in detector.classes:
        label, own = CLASSES.index(name), detector.classes.index(name)
        strict, loose, recalled = [], [], 0
        boxes = 0
        for frame, detections in zip(frames, found, strict=True):
            geometry = frame.boxes.geometry
            counted = count_points(xyz(frame.cloud), geometry) >= MIN_POINTS
            counted &= detector.range_m.contains_centres(geometry)
            of_class, chosen = frame.boxes.labels == label, detections.labels == own
            truth, counted = geometry[of_class], counted[of_class]
            guesses, scores = detections.boxes[chosen], detections.scores[chosen]
            strict.append(match_frame(truth, counted, guesses, scores, STRICT_IOU[name]))
            loose.append(match_frame(truth, counted, guesses, scores, LOOSE_IOU[name]))
            overlap = iou_bev(truth[counted], guesses[scores >= LEAST_SCORE])
            recalled += int((overlap.max(axis=1, initial=0.0) >= LOOSE_IOU[name]).sum())
            boxes += int(counted.sum())
        recall = recalled / boxes if boxes else float("nan")
        out[name] = ClassFigures(boxes, recall, average_precision(strict), average_precision(loose))
    return out


def compare(
    detector: ObjectDetector, frames: Sequence[LabelledCloud], conditions: Mapping[str, Float64] = CONDITIONS
) -> Iterator[tuple[str, dict[str, ClassFigures]]]:
    """The figures under each condition."""
    for name, new_SE3_old in conditions.items():
        seen = [frame.seen_from(new_SE3_old) for frame in frames]
        yield name, figures(seen, [detector.detect(frame.cloud) for frame in seen], detector)


def rows(results: Iterable[tuple[str, dict[str, ClassFigures]]]) -> Iterator[str]:
    """A Markdown table, a line at a time: for each class recall / strict AP / loose AP."""
    is_first = True
    for name, classes in results:
        if is_first:
            yield "| |" + "|".join(f" {each} ({got.boxes}) " for each, got in classes.items()) + "|"
            yield "|---|" + "---|" * len(classes)
            is_first = False
        cells = (f" {got.recall:.2f} / {got.strict_ap:.3f} / {got.loose_ap:.3f} " for got in classes.values())
        yield f"| {name} |" + "|".join(cells) + "|"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("detector")
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("--frames", default="::5")
    parser.add_argument("--level", action="store_true")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    from advpipe.pipeline.bag.frames import FrameSlice, read_frames
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.core.errors import AdvpipeError
    from advpipe.pipeline.detector.adaptation import Adaptation
    from advpipe.pipeline.detector.adapted import adapted_detector
    from advpipe.pipeline.detector.registry import load_detector

    try:
        detector = adapted_detector(
            load_detector(options.detector, options.device), Adaptation(level=options.level)
        )
        chosen = FrameSlice.parse(options.frames)
        for bag in options.bags:
            frames = [LabelledCloud(f.cloud, f.boxes) for f in read_frames(resolve_bag(bag), chosen)]
            print(f"\n{bag}, {len(frames)} frames: recall / strict AP / loose AP (boxes)", flush=True)
            for line in rows(compare(detector, frames)):
                print(line, flush=True)
    except AdvpipeError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
