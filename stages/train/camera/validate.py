"""The average precision of an image detector on the pictures of a drive that it did not learn from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.image_detector.protocol import ImageDetector
from advpipe.pipeline.image_detector.scoring import PicturePrecision, picture_precisions
from advpipe.stages.train.camera.pictures import LabelledPicture, labelled_cameras, labelled_pictures

MODERATE = "moderate"


@dataclass(frozen=True)
class PictureDrive:
    """The pictures of a bag."""

    bag: Path

    def __len__(self) -> int:
        reader = BagReader(self.bag)
        return sum(reader.topics[camera.image_topic].count for camera in labelled_cameras(self.bag))

    def precision(self, detector: ImageDetector, at_most: int | None = None) -> tuple[PicturePrecision, ...]:
        """On all pictures, or on about `at_most`, equally spaced."""
        step = max(1, len(self) // (at_most or len(self)))
        pictures: Iterable[LabelledPicture] = islice(labelled_pictures(self.bag), 0, None, step)
        if at_most is None:
            pictures = track(pictures, "validate", total=len(self))
        truths, found = [], []
        for picture in pictures:
            truths.append(picture.truth)
            found.append(detector.detect(picture.rgb))
        return tuple(picture_precisions(truths, found, detector.classes))


def moderate_percents(precisions: Sequence[PicturePrecision]) -> Mapping[str, float]:
    """The strict average precision of each class at moderate difficulty; NaN without objects."""
    found = {each.class_name: 100 * each.strict for each in precisions if each.difficulty == MODERATE}
    return {name: found.get(name, float("nan")) for name in CLASSES}
