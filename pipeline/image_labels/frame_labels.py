"""The lines of a label file: as they were labelled in pictures, or as the boxes appear there."""

from __future__ import annotations

import math
from collections.abc import Iterator

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.geometry.boxes import CLASSES, count_points
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.image_labels.label_camera import CameraAtFrame
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.kitti.object_label import ObjectLabel, camera_box, observation_angle
from advpipe.pipeline.kitti.occlusion import occlusion_level
from advpipe.pipeline.kitti.projection import project_box
from advpipe.pipeline.messages.cloud import xyz

UNKNOWN_OCCLUSION = 3
"""Counts in none of KITTI's difficulties."""


def frame_labels(frame: Frame, camera: CameraAtFrame) -> tuple[list[ObjectLabel], int]:
    """The labels of a frame, and how many objects are not in the picture and left out."""
    boxes = _boxes_by_id(frame)
    if camera.labels is None:
        labels = list(_projected(frame, boxes, camera))
        return labels, len(boxes) - len(labels)
    labels = list(_as_labelled(frame, boxes, camera))
    return labels, len(boxes) - sum(label.has_box for label in labels)


def _boxes_by_id(frame: Frame) -> list[tuple[str, str, Float64]]:
    """Id, class and box (7,) of all objects, those included that count neither way."""
    counted = [
        (name, KITTI_NAMES[CLASSES[label]], box)
        for name, label, box in zip(frame.boxes.ids, frame.boxes.labels, frame.boxes.geometry, strict=True)
    ]
    ignored = frame.uncounted.boxes
    return counted + [
        (name, KITTI_NAMES.get(class_name, class_name.replace(" ", "_")), box)
        for name, class_name, box in zip(ignored.ids, ignored.class_names, ignored.geometry, strict=True)
    ]


def _as_labelled(
    frame: Frame, boxes: list[tuple[str, str, Float64]], camera: CameraAtFrame
) -> Iterator[ObjectLabel]:
    """The image's labels in their order, each with its box; boxes that have none are projected."""
    by_id = {name: box for name, _, box in boxes}
    labels = camera.labels or ()
    with_box = [label for label in labels if label.id and label.id in by_id]
    for label in with_box:
        yield ObjectLabel(
            label.class_name.replace(" ", "_"),
            label.truncation,
            label.occlusion if label.occlusion >= 0 else UNKNOWN_OCCLUSION,
            label.observation_angle_rad,
            label.edges_px,
            *camera_box(by_id[label.id], camera.calibration),
        )
    labelled = {label.id for label in with_box}
    yield from _projected(frame, [each for each in boxes if each[0] not in labelled], camera)
    for label in labels:  # KITTI's readers take the DontCare at the end of a file for granted
        if not label.id:
            yield ObjectLabel(
                label.class_name.replace(" ", "_"),
                label.truncation,
                label.occlusion,
                label.observation_angle_rad,
                label.edges_px,
            )


def _projected(
    frame: Frame, boxes: list[tuple[str, str, Float64]], camera: CameraAtFrame
) -> Iterator[ObjectLabel]:
    image_P_lidar = camera.calibration.image_P_lidar()
    for name, class_name, box in boxes:
        rectangle = project_box(image_P_lidar, box, *camera.size_px)
        if rectangle is None:
            continue
        size_m, bottom_m, rotation_y_rad = camera_box(box, camera.calibration)
        yield ObjectLabel(
            class_name,
            rectangle.truncation,
            _occlusion(frame, camera, name, box),
            observation_angle(bottom_m, rotation_y_rad),
            rectangle.edges_px,
            size_m,
            bottom_m,
            rotation_y_rad,
        )


def _occlusion(frame: Frame, camera: CameraAtFrame, name: str, box: Float64) -> int:
    """KITTI's level from the occluded share; an object that no ray met is at an unknown one.

    Where the share is unknown, as in bags of other tools, an object that points lie on is taken as visible.
    """
    share = camera.occlusion.get(name, math.nan)
    if math.isnan(share):
        return 0 if count_points(xyz(frame.cloud), [box])[0] else UNKNOWN_OCCLUSION
    if camera.lidar_points.get(name, 0) == 0:
        return UNKNOWN_OCCLUSION
    return occlusion_level(share)
