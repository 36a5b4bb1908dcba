"""The view of one camera as messages: images, calibration and ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.messages import images
from advpipe.pipeline.messages.labels import image_labels_message
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.sensors.camera.lens import Fisheye
from advpipe.pipeline.sensors.camera.palette import PALETTE_RGB
from advpipe.pipeline.sensors.camera.picture import Layers
from advpipe.pipeline.sensors.camera.rig import CameraView
from advpipe.pipeline.sensors.camera.section import CameraSensor

OPTICAL = "_optical_frame"
"""Ending of the name of a camera's optical frame."""

MAX_DEPTH_MM = 65_535


class InstanceIds:
    """Ids of road users from 1 on, in the order in which the cameras of a vehicle first see them."""

    def __init__(self) -> None:
        self._ids: dict[str, int] = {}

    def of(self, names: Sequence[str]) -> list[int]:
        """The ids of road users by name; beyond 65,535, they are counted anew."""
        for name in names:
            self._ids.setdefault(name, len(self._ids) % 65_535 + 1)
        return [self._ids[name] for name in names]


def camera_messages(
    vehicle: str,
    name: str,
    section: CameraSensor,
    stamp_ns: int,
    view: CameraView,
    ids: InstanceIds,
    workers: Executor,
) -> list[StampedCdr]:
    """All messages of one camera at one instant; the workers compress its images meanwhile."""
    topics, frame_id = VehicleTopics(vehicle), VehicleTopics(vehicle).sensor_frame(name + OPTICAL)
    lens, layers = view.lens, view.layers

    def message(topic: Topic, value: Any) -> StampedCdr:
        return topic, serialise(value, topic.type), stamp_ns

    shown = np.flatnonzero(layers.visible).tolist()
    known = dict(zip(shown, ids.of([view.ids[each] for each in shown]), strict=True))

    def compressed(kind: str) -> StampedCdr:
        if kind == "rgb" and view.rgb is not None:
            image = images.jpeg_message(stamp_ns, frame_id, view.rgb, section.jpeg_quality)
        else:
            image = images.png_message(stamp_ns, frame_id, _png_image(kind, layers, lens, known))
        return message(topics.camera_image(name, kind), image)

    info = images.camera_info_message(
        stamp_ns, frame_id, lens.size_px, lens.matrix, lens.distortion_model, lens.distortion
    )
    others = [message(topics.camera_info(name), info)]  # loads the types of messages before threads do
    kinds = [] if view.rgb is None else ["rgb"]
    kinds += [kind for kind in section.images if kind != "rgb"]
    pictures = workers.map(compressed, kinds)
    visible = [(o.id, o.class_name, o.visible_share, o.visible_px) for o in view.objects if o.visible_px]
    amodal = [(o.id, o.class_name, o.visible_share, o.amodal_px) for o in view.objects]
    others.append(
        message(topics.visible_boxes(name), images.image_boxes_message(stamp_ns, frame_id, visible))
    )
    others.append(message(topics.amodal_boxes(name), images.image_boxes_message(stamp_ns, frame_id, amodal)))
    labels = [each.label for each in view.objects]
    others.append(message(topics.image_labels(name), image_labels_message(stamp_ns, frame_id, labels)))
    if "instance_segmentation" in section.images:
        of_ids = {number: view.ids[index] for index, number in known.items()}
        others.append(
            message(topics.instance_names(name), images.label_info_message(stamp_ns, frame_id, of_ids))
        )
    return [*pictures, *others]


def _png_image(kind: str, layers: Layers, lens: Any, known: dict[int, int]) -> npt.NDArray[Any]:
    """The image (H, W) of depth in millimetres, or (H, W, 3) of a segmentation."""
    width, height = lens.size_px
    if kind == "depth":
        return depth_mm(layers, lens).reshape(height, width)
    if kind == "semantic_segmentation":
        return PALETTE_RGB[layers.tags].reshape(height, width, 3)
    table = np.zeros(max(known, default=-1) + 2, np.int64)  # the last entry, 0, is for no road user
    for index, number in known.items():
        table[index] = number
    ids = table[layers.objects]
    channels = (layers.tags, ids & 255, ids >> 8)
    return np.stack([each.astype(np.uint8) for each in channels], axis=-1).reshape(height, width, 3)


def depth_mm(layers: Layers, lens: Any) -> npt.NDArray[np.uint16]:
    """Depth (P,) in millimetres along the optical axis, of a fisheye along the ray; 0 where it is unknown."""
    depth = layers.range_m.astype(np.float64)
    if not isinstance(lens, Fisheye):
        width, height = lens.size_px
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        depth *= lens.directions(np.column_stack([x.ravel(), y.ravel()]))[:, 2]
    known = np.isfinite(depth) & (depth * 1000 <= MAX_DEPTH_MM)
    return np.where(known, np.rint(np.where(known, depth, 0) * 1000), 0).astype(np.uint16)
