"""The cameras of a recorded drive: their main images, and how these are projected."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.compressed_image import IMAGE_TYPE, MOST_PIXELS
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.camera.lens import Lens, lens_of

_TOPIC = re.compile(r"^/([^/]+)/([^/]+)/image/compressed$")

_PROJECTIONS = {"plumb_bob": "pinhole", "equidistant": "fisheye"}
"""Kinds of lenses by the distortion models of sensor_msgs/CameraInfo."""


@dataclass(frozen=True)
class RecordedCamera:
    """One camera of a drive, and its topics."""

    vehicle: str
    name: str

    @property
    def image_topic(self) -> str:
        """Of its main images."""
        return VehicleTopics(self.vehicle).camera_image(self.name, "rgb").name

    @property
    def info_topic(self) -> str:
        """Of its calibration."""
        return VehicleTopics(self.vehicle).camera_info(self.name).name

    @property
    def labels_topic(self) -> str:
        """Of what is labelled in its images."""
        return VehicleTopics(self.vehicle).image_labels(self.name).name

    @property
    def amodal_topic(self) -> str:
        """Of the 2D boxes of whole objects."""
        return VehicleTopics(self.vehicle).amodal_boxes(self.name).name


def cameras_of(reader: BagReader) -> list[RecordedCamera]:
    """The cameras whose main images a bag holds, by vehicle and name; those of other tools too, if their
    topics are named as in docs/bags.md."""
    matches = [_TOPIC.match(topic) for topic in sorted(reader.topics_of_type(IMAGE_TYPE))]
    return [RecordedCamera(match[1], match[2]) for match in matches if match]


def camera_lens(reader: BagReader, camera: RecordedCamera) -> Lens:
    """The projection of a camera, from its first CameraInfo. Raises AdvpipeError for a bag that has none, for
    a model that is neither plumb_bob nor equidistant, and for images without pixels or with too many."""
    topic, info = camera.info_topic, None
    if topic in reader.topics:
        info = next((message for _, message in reader.messages(topic)), None)
    if info is None:
        raise UsageError(f"{reader.path} does not say how {camera.image_topic} is projected (no {topic})")
    projection = _PROJECTIONS.get(info.distortion_model)
    matrix = np.asarray(info.k, np.float64).reshape(3, 3)
    if projection is None or not (np.isfinite(matrix).all() and matrix[0, 0] > 0 < matrix[1, 1]):
        raise UsageError(
            f"{reader.path}: {topic} has the distortion model {info.distortion_model[:40]!r}; "
            f"known: {', '.join(_PROJECTIONS)}"
        )
    size_px = int(info.width), int(info.height)
    if not (min(size_px) > 0 and size_px[0] * size_px[1] <= MOST_PIXELS):
        raise UsageError(f"{reader.path}: {topic} is of images of {size_px[0]} x {size_px[1]} pixels")
    return lens_of(projection, size_px, matrix, info.d.tolist())
