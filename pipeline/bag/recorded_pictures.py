"""The pictures of the cameras in a bag, and what is labelled in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import RecordedCamera as RecordedCamera
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.messages.build import stamp_ns
from advpipe.pipeline.messages.images import decoded_rgb
from advpipe.pipeline.messages.labels import ImageLabel, image_labels_from_message


@dataclass(frozen=True)
class Picture:
    """A compressed picture. stamp_ns: when it was taken, log_time_ns: when it arrived. data: of its file."""

    stamp_ns: int
    log_time_ns: int
    data: bytes

    def rgb(self, where: object) -> npt.NDArray[np.uint8]:
        """The picture (H, W, 3). Raises AdvpipeError, naming `where` it is, for one that cannot be read."""
        try:
            return decoded_rgb(self.data)
        except ValueError as error:
            raise AdvpipeError(one_line(f"{where}: the picture at {self.stamp_ns} ns {error}")) from None


def recorded_cameras(reader: BagReader) -> list[RecordedCamera]:
    """The cameras of all vehicles by name, as far as pictures and labels of them are in the bag."""
    return [each for each in cameras_of(reader) if each.labels_topic in reader.topics]


def read_pictures(
    reader: BagReader, camera: RecordedCamera, window: Window = WHOLE_DRIVE
) -> Iterator[Picture]:
    """The pictures of a camera in the order in which they arrive; none where the bag has no such topic."""
    if camera.image_topic not in reader.topics:
        return
    for raw in reader.raw_messages([camera.image_topic], window.begin_ns, window.last_ns):
        message = reader.decode(raw)
        yield Picture(stamp_ns(message), raw.log_time_ns, bytes(message.data))


def read_labels(
    reader: BagReader, camera: RecordedCamera, window: Window = WHOLE_DRIVE
) -> dict[int, tuple[ImageLabel, ...]]:
    """What is labelled in each picture, by the picture's stamp."""
    raws = reader.raw_messages([camera.labels_topic], window.begin_ns, window.last_ns)
    return {stamp_ns(message): image_labels_from_message(message) for message in map(reader.decode, raws)}


def read_visible_shares(reader: BagReader, camera: RecordedCamera) -> dict[int, dict[str, float]]:
    """The visible share of each object by its id, by the picture's stamp; empty where it is not recorded."""
    if camera.amodal_topic not in reader.topics:
        return {}
    return {
        stamp_ns(message): {
            each.id: float(each.results[0].hypothesis.score) for each in message.detections if each.results
        }
        for message in map(reader.decode, reader.raw_messages([camera.amodal_topic]))
    }
