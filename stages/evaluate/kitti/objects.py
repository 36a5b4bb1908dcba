"""Labels and detections of a frame as KITTI's evaluation takes them: in the image and before the camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.image_labels.frame_labels import frame_labels
from advpipe.pipeline.image_labels.label_camera import CameraAtFrame
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.kitti.object_label import ObjectLabel, camera_box, observation_angle
from advpipe.pipeline.kitti.projection import project_box
from advpipe.pipeline.metrics.kitti_objects import Float64, KittiObjects


def labelled_objects(frame: Frame, camera: CameraAtFrame) -> KittiObjects:
    """The labels of a frame, those of `DontCare` among them."""
    return _objects(frame_labels(frame, camera)[0])


def detected_objects(detections: Detections, camera: CameraAtFrame) -> KittiObjects:
    """The detections that appear in the image; labels index `geometry.boxes.CLASSES`."""
    image_P_lidar = camera.calibration.image_P_lidar()
    labels, scores = [], []
    for box, label, score in zip(detections.boxes, detections.labels, detections.scores, strict=True):
        rectangle = project_box(image_P_lidar, box, *camera.size_px)
        if rectangle is None:
            continue
        size_m, bottom_m, rotation_y_rad = camera_box(box, camera.calibration)
        alpha_rad = observation_angle(bottom_m, rotation_y_rad)
        name = KITTI_NAMES[CLASSES[label]]
        labels.append(
            ObjectLabel(name, 0.0, 0, alpha_rad, rectangle.edges_px, size_m, bottom_m, rotation_y_rad)
        )
        scores.append(float(score))
    return _objects(labels, np.array(scores))


def _objects(labels: Sequence[ObjectLabel], scores: Float64 | None = None) -> KittiObjects:
    return KittiObjects(
        names=tuple(label.class_name for label in labels),
        bbox_px=np.array([label.edges_px for label in labels]).reshape(-1, 4),
        truncated=np.array([label.truncation for label in labels]),
        occluded=np.array([label.occlusion for label in labels], np.float64),
        boxes=np.array([(*label.size_m, *label.bottom_m, label.rotation_y_rad) for label in labels]).reshape(
            -1, 7
        ),
        alpha_rad=np.array([label.alpha_rad for label in labels]),
        scores=scores,
    )
