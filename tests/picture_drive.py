"""A drive of a camera whose pictures are plain rectangles, a colour for each class, on grey noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.image_detector.protocol import ImageDetections
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.messages.images import image_boxes_message, png_message
from advpipe.pipeline.messages.labels import ImageLabel, image_labels_message
from advpipe.pipeline.messages.topics import VehicleTopics

START_NS = 1_767_268_800_000_000_000
STEP_NS = 100_000_000
COLOURS = np.array([[250, 20, 20], [240, 240, 20], [20, 240, 240], [20, 250, 20]], np.uint8)
"""In the order of `CLASSES`."""
TOPICS = VehicleTopics("ego")
CAMERA = "front"
FRAME = TOPICS.sensor_frame("front_optical_frame")

Image = npt.NDArray[np.uint8]
Painted = tuple[int, tuple[int, int, int, int]]
"""The label of a rectangle, and its left, top, right and bottom pixel."""


def painted(rectangles: Sequence[Painted], size_px: tuple[int, int] = (192, 128)) -> Image:
    width, height = size_px
    image = np.random.default_rng(0).integers(90, 130, (height, width, 3)).astype(np.uint8)
    for label, (left, top, right, bottom) in rectangles:
        image[top : bottom + 1, left : right + 1] = COLOURS[label]
    return image


def rectangles_at(number: int) -> list[Painted]:
    """A car of 61 x 41 pixels that moves to the right, and a pedestrian of 16 x 46 that stands."""
    return [(0, (10 + 2 * number, 60, 70 + 2 * number, 100)), (3, (150, 50, 165, 95))]


def label_of(name: str, rectangle: Painted) -> ImageLabel:
    label, edges = rectangle
    left, top, right, bottom = map(float, edges)
    return ImageLabel(name, KITTI_NAMES[CLASSES[label]], (left, top, right, bottom), 0.0, 0)


def record_pictures(
    path: Path,
    steps: int = 6,
    *,
    shown: Callable[[int], Image | None] = lambda number: painted(rectangles_at(number)),
    late_ns: int = 0,
) -> Path:
    """Write the drive; `shown` is what the camera shows at each step, None for no picture."""
    with BagWriter(path, provenance={"kind": "clean", "map_sha256": "a" * 64}) as bag:
        for number in range(steps):
            now_ns, truth = START_NS + number * STEP_NS, rectangles_at(number)
            image = shown(number)
            if image is not None:
                message = png_message(now_ns, FRAME, image)
                bag.write(TOPICS.camera_image(CAMERA, "rgb"), message, now_ns + late_ns)
            labels = [label_of(f"user-{place}", each) for place, each in enumerate(truth)]
            boxes = [
                (f"user-{place}", CLASSES[label], 1.0, edges) for place, (label, edges) in enumerate(truth)
            ]
            bag.write(TOPICS.image_labels(CAMERA), image_labels_message(now_ns, FRAME, labels), now_ns)
            bag.write(TOPICS.amodal_boxes(CAMERA), image_boxes_message(now_ns, FRAME, boxes), now_ns)
    return path


class ColourDetector:
    """Finds the one rectangle of each colour; its score is the share of the rectangle that has the colour."""

    classes = CLASSES

    def detect(self, image: Image) -> ImageDetections:
        boxes, scores, labels = [], [], []
        for label, colour in enumerate(COLOURS):
            rows, columns = np.nonzero((image == colour).all(axis=2))
            if len(rows):
                box = [columns.min(), rows.min(), columns.max(), rows.max()]
                boxes.append(box)
                scores.append(len(rows) / ((box[2] - box[0] + 1) * (box[3] - box[1] + 1)))
                labels.append(label)
        return ImageDetections(
            np.array(boxes, np.float32).reshape(-1, 4),
            np.array(scores, np.float32),
            np.array(labels, np.int64),
        )
