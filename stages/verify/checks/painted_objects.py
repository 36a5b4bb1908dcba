"""How large what was painted on a road user must be, by where the bag says that this stands."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import RecordedCamera, camera_lens
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.compressed_image import StampedImage
from advpipe.pipeline.messages.topics import VehicleTopics

ROUNDED_PX = 2.0
"""By which a rectangle of whole pixels may be wider and higher than what it holds."""


class PaintedObjects:
    """Looks up road users at the instants of images, asked for in time order."""

    def __init__(self, clean: BagReader, camera: RecordedCamera) -> None:
        self._clean, self._camera = clean, camera
        self._topics = VehicleTopics(camera.vehicle)
        objects = objects_topic(clean, self._topics)
        self._truth = GroundTruth(clean, self._topics, objects) if objects else None

    def extent_m(self, image: StampedImage, target: str, edges_px: tuple[int, int, int, int]) -> float | None:
        """The least diagonal of something on a road user that fills a rectangle of the image; None where the
        bag does not tell.

        The angle of the rectangle's longer side, over the distance of the nearest place of the road user's
        box: nothing on it can be smaller and look as large, however it is turned.
        """
        if self._truth is None:
            return None
        stamp_ns, base = image.stamp_ns, self._topics.base_frame
        wanted = sorted(set(self._truth.topic_names) & self._clean.topics.keys())
        for raw in self._clean.raw_messages(wanted, stamp_ns, stamp_ns):
            self._truth.take(raw)
        try:
            boxes, lens = self._truth.boxes(stamp_ns, base), camera_lens(self._clean, self._camera)
            camera_m = self._truth.lidar_SE3(image.frame_id, stamp_ns, base)[:3, 3]
        except AdvpipeError:
            return None
        if target not in boxes.ids:
            return None
        left, top, right, bottom = edges_px
        across, down = max(right - left + 1 - ROUNDED_PX, 0), max(bottom - top + 1 - ROUNDED_PX, 0)
        middle = np.array([left + right, top + bottom]) / 2
        sides = np.array([(-across, 0), (across, 0), (0, -down), (0, down)]) / 2
        rays = lens.directions(middle + sides)
        cosine = min(rays[0] @ rays[1], rays[2] @ rays[3])
        angle_rad = float(np.arccos(np.clip(cosine, -1, 1)))
        nearest_m = _distance(boxes.geometry[boxes.ids.index(target)], camera_m)
        return None if np.isnan(angle_rad) else float(2 * np.tan(angle_rad / 2) * nearest_m)


def _distance(box: Float64, point_m: Float64) -> float:
    """From a point (3,) to the nearest place of a box (7,)."""
    cos, sin = np.cos(box[6]), np.sin(box[6])
    x, y, z = point_m - box[:3]
    local = np.abs([x * cos + y * sin, y * cos - x * sin, z])
    return float(np.linalg.norm(np.maximum(local - box[3:6] / 2, 0)))
