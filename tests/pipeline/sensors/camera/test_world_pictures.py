"""Cameras in a world that takes the pictures itself."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.messages.types import typestore
from advpipe.pipeline.sensors.camera.cameras import Cameras
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.picture import Layers, extents
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.camera.world_pictures import Picture
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant
from advpipe.pipeline.sensors.weather import Weather

WIDTH, HEIGHT = 32, 24
ALL = ("rgb", "depth", "semantic_segmentation", "instance_segmentation")


class PaintingWorld:
    """One car, in a rectangle of the picture; the left half of it is visible."""

    def road_users(self, range_m: float) -> Boxes:
        return Boxes(
            np.array([[20.0, 0, 1, 4, 2, 2, 0]]), np.zeros(1, np.int64), ("other",), np.zeros((1, 3))
        )

    def cast(self, rays: Any, range_m: float) -> Any:
        raise AssertionError("no ray is needed")

    def picture(self, name: str, boxes: Boxes) -> Picture:
        assert (name, boxes.ids) == ("front", ("other",))
        rectangle = np.zeros((HEIGHT, WIDTH), np.bool_)
        rectangle[10:14, 8:20] = True
        alone = np.flatnonzero(rectangle.ravel())
        objects = np.full(WIDTH * HEIGHT, -1, np.int32)
        objects[alone[alone % WIDTH < 14]] = 0
        own = np.flatnonzero(objects == 0)
        (seen, seen_px), (whole, whole_px) = (
            extents(pixels, np.zeros(len(pixels), np.int64), 1, WIDTH) for pixels in (own, alone)
        )
        range_m = np.where(objects == 0, 18.0, np.inf).astype(np.float32)
        tags = np.where(objects == 0, TAG["Car"], TAG["Sky"]).astype(np.uint8)
        rgb = np.full((HEIGHT, WIDTH, 3), 77, np.uint8)
        return Picture(rgb, Layers(range_m, tags, objects, seen, whole, seen_px, whole_px))


def test_messages_are_those_of_the_picture() -> None:
    from PIL import Image

    section = CameraSensor(image_size_x=WIDTH, image_size_y=HEIGHT, images=ALL, sensor_tick=0.2)
    drive = DriveSettings(7, 0.1, Weather(), False)
    cameras = Cameras("ego", {"front": section}, drive)
    motion = MotionStep(np.eye(4), np.zeros(3), np.zeros(3), np.zeros((0, 3)))
    assert not cameras.sense(Instant(1, 0, motion, PaintingWorld())).messages
    reading = cameras.sense(Instant(2, 10**9, motion, PaintingWorld()))
    found = {topic.name: typestore().deserialize_cdr(cdr, topic.type) for topic, cdr, _ in reading.messages}
    picture = np.asarray(Image.open(io.BytesIO(bytes(found["/ego/front/image/compressed"].data))))
    assert np.abs(picture.astype(int) - 77).max() <= 1
    ids = np.asarray(Image.open(io.BytesIO(bytes(found["/ego/front/instance_segmentation/compressed"].data))))
    assert ids[11, 9].tolist() == [TAG["Car"], 1, 0]
    (one,) = found["/ego/ground_truth/front/visible_boxes"].detections
    assert (one.id, one.bbox.size_x, one.bbox.size_y) == ("other", 6, 4)
    assert one.results[0].hypothesis.score == 0.5
    (one,) = found["/ego/ground_truth/front/amodal_boxes"].detections
    assert (one.bbox.center.position.x, one.bbox.size_x) == (13.5, 12)
    assert reading.road_users == ("other",)


def test_what_a_world_lacks_for_cameras() -> None:
    assert Cameras.missing_from(frozenset({"road users", "pictures"})) == []
    assert Cameras.missing_from(frozenset({"road users", "rays"})) == ["surfaces"]
