"""What an image detector finds in the pictures that a receiver has at each moment."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_pictures import Picture, RecordedCamera, read_labels, read_pictures
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.image_detector.protocol import ImageDetections, ImageDetector
from advpipe.pipeline.image_detector.scoring import PictureTruth

NOTHING = ImageDetections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64))
"""Before the first picture has arrived."""


@dataclass(frozen=True)
class Moment:
    """When the clean bag has a labelled picture. digest: of the picture that the receiver has then, of
    whichever bag; "" for none yet. stamp_ns: of the clean one."""

    stamp_ns: int
    truth: PictureTruth
    digest: str


class SeenPictures:
    """Detections by picture, each distinct one looked at once: bags share most of them."""

    def __init__(self, detector: ImageDetector) -> None:
        self.detector = detector
        self._found: dict[str, ImageDetections] = {"": NOTHING}

    def clean(self, reader: BagReader, camera: RecordedCamera, window: Window) -> list[Moment]:
        """The moments of a camera in a window: each labelled picture of the clean bag."""
        labels = read_labels(reader, camera)
        count = reader.topics[camera.image_topic].count
        pictures = track(read_pictures(reader, camera, window), f"{camera.vehicle}: {camera.name}", count)
        return [
            Moment(each.stamp_ns, PictureTruth.of(labels[each.stamp_ns]), self._look(reader, camera, each))
            for each in pictures
            if each.stamp_ns in labels
        ]

    def attacked(
        self,
        clean: BagReader,
        reader: BagReader,
        camera: RecordedCamera,
        moments: Sequence[Moment],
        window: Window,
    ) -> list[Moment]:
        """The same moments with the newest picture of another bag that has arrived by then, an old one where
        pictures are late or missing; only those where it is not the clean bag's."""
        arrivals = {each.stamp_ns: each.log_time_ns for each in read_pictures(clean, camera, window)}
        pictures = read_pictures(reader, camera, window)
        shown, following, found = "", next(pictures, None), []
        for moment in moments:
            while following is not None and following.log_time_ns <= arrivals[moment.stamp_ns]:
                shown, following = self._look(reader, camera, following), next(pictures, None)
            if shown != moment.digest:
                found.append(Moment(moment.stamp_ns, moment.truth, shown))
        return found

    def found(self, moments: Sequence[Moment]) -> list[ImageDetections]:
        """The detections at each moment."""
        return [self._found[moment.digest] for moment in moments]

    def _look(self, reader: BagReader, camera: RecordedCamera, picture: Picture) -> str:
        digest = hashlib.sha256(picture.data).hexdigest()
        if digest not in self._found:
            rgb = picture.rgb(f"{reader.path}: {camera.image_topic}")
            self._found[digest] = self.detector.detect(rgb)
        return digest


def pictures_by_digest(
    reader: BagReader, camera: RecordedCamera, window: Window, wanted: set[str]
) -> Iterator[tuple[str, Picture]]:
    """The wanted pictures of a bag, to be drawn."""
    for picture in read_pictures(reader, camera, window):
        digest = hashlib.sha256(picture.data).hexdigest()
        if digest in wanted:
            yield digest, picture
