"""A picture as the detector sees it, clean and attacked, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_pictures import RecordedCamera
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.image_detector.protocol import ImageDetections
from advpipe.stages.evaluate.camera.seen import Moment, SeenPictures, pictures_by_digest
from advpipe.stages.evaluate.report.style import PREDICTION

LEAST_SCORE = 0.3
"""Of the detections that are drawn."""


def draw_pictures(
    clean: BagReader,
    attacked: BagReader,
    camera: RecordedCamera,
    before: Sequence[Moment],
    after: Sequence[Moment],
    seen: SeenPictures,
    window: Window,
) -> Figure:
    """The moment at which the detections change most, of those whose clean and attacked pictures differ."""
    found = seen.found(before), seen.found(after)
    changes = [abs(_sum(one) - _sum(other)) for one, other in zip(*found, strict=True)]
    worst = int(np.argmax(changes))
    wanted = before[worst].digest, after[worst].digest
    images = {
        digest: picture.rgb(reader.path)
        for reader in (clean, attacked)
        for digest, picture in pictures_by_digest(reader, camera, window, set(wanted))
    }
    figure = Figure(figsize=(10, 3.2), dpi=110, facecolor="white", layout="constrained")
    for axes, title, digest, each in zip(
        figure.subplots(1, 2), ("clean", "attacked"), wanted, (found[0][worst], found[1][worst]), strict=True
    ):
        axes.set_axis_off()
        axes.set_title(title, fontsize=9)
        if digest in images:
            _draw(axes, images[digest], each, seen.detector.classes)
    return figure


def _sum(found: ImageDetections) -> float:
    return float(found.scores[found.scores >= LEAST_SCORE].sum())


def _draw(axes: object, image: npt.NDArray[np.uint8], found: ImageDetections, classes: Sequence[str]) -> None:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle

    assert isinstance(axes, Axes)
    axes.imshow(image)
    for box, score, label in zip(found.boxes_px.tolist(), found.scores, found.labels, strict=True):
        if score < LEAST_SCORE:
            continue
        left, top, right, bottom = box
        axes.add_patch(
            Rectangle((left, top), right - left, bottom - top, fill=False, color=PREDICTION, linewidth=1)
        )
        axes.text(left, top - 2, f"{classes[label]} {score:.2f}", fontsize=5, color=PREDICTION)
