"""The camera in whose image KITTI's labels are made: the bag's own, or a virtual one like KITTI's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.bag.frames import find_lidar_topic, vehicle_topics
from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import invert, se3
from advpipe.pipeline.kitti.calibration import CAMERAS, LABELLED_CAMERA, KittiCalibration
from advpipe.pipeline.messages.build import stamp_ns as header_stamp_ns
from advpipe.pipeline.messages.labels import ImageLabel, image_labels_from_message
from advpipe.pipeline.messages.topics import TF

SIZE_PX = (1242, 375)
"""Width and height of a virtual picture."""

_VIRTUAL_P = np.array([[721.5377, 0.0, 609.5593, 0.0], [0.0, 721.5377, 172.854, 0.0], [0.0, 0.0, 1.0, 0.0]])
"""The projection of most of KITTI's pictures."""

_AHEAD_M, _BELOW_M = 0.27, 0.08
"""Where KITTI's cameras stand, seen from its LiDAR."""


@dataclass(frozen=True)
class CameraAtFrame:
    """What is known of the camera at one frame. labels: by the ids of 3D boxes, and those without; None where
    nothing was labelled in pictures. occlusion, lidar_points: of each road user by its id, where known."""

    calibration: KittiCalibration
    size_px: tuple[int, int]
    labels: tuple[ImageLabel, ...] | None
    occlusion: Mapping[str, float]
    lidar_points: Mapping[str, int]


class LabelCamera:
    """Looks up the camera at the instants of clouds, asked for in time order.

    Where the bag has the calibration of `camera_2`, as an import of KITTI leaves it, this is taken, with what
    was labelled in its images; else a camera that the vehicle itself carries; else all four cameras are one
    virtual camera that looks forward. name: of the camera whose images are labelled; None for a virtual one.
    """

    def __init__(self, bag: Path, lidar_topic: str | None) -> None:
        self._reader = BagReader(bag)
        self._topics = vehicle_topics(find_lidar_topic(self._reader, lidar_topic))
        self._lidar_frame = self._topics.lidar_frame
        self.name = self._labelled_camera()
        self.is_virtual = self.name is None
        self._truth = GroundTruth(self._reader, self._topics, self._topics.objects.name)

    def at(self, stamp_ns: int) -> CameraAtFrame:
        """The camera at a cloud's stamp. Raises AdvpipeError for a bag that does not say where it is."""
        users = self._message(self._topics.road_users.name, stamp_ns)
        known = users.road_users if users is not None else []
        # Bags of the first version lack the occlusion.
        occlusion = {user.id: float(getattr(user, "occlusion", np.nan)) for user in known}
        points = {user.id: int(user.lidar_points) for user in known}
        if self.is_virtual:
            return CameraAtFrame(virtual_calibration(), SIZE_PX, None, occlusion, points)
        if self.name != _name(LABELLED_CAMERA):
            return self._carried(str(self.name), stamp_ns, occlusion, points)
        infos = {
            camera: info
            for camera in CAMERAS
            if (info := self._message(self._info_topic(camera), stamp_ns)) is not None
        }
        if LABELLED_CAMERA not in infos:
            return CameraAtFrame(virtual_calibration(), SIZE_PX, None, occlusion, points)
        own = infos[LABELLED_CAMERA]
        labels = self._message(self._topics.image_labels(_name(LABELLED_CAMERA)).name, stamp_ns)
        return CameraAtFrame(
            self._calibration(infos, stamp_ns),
            (int(own.width), int(own.height)),
            None if labels is None else image_labels_from_message(labels),
            occlusion,
            points,
        )

    def _labelled_camera(self) -> str | None:
        """KITTI's camera 2, or the first pinhole by name whose images are labelled and not distorted.

        Labels and detections are compared in the image that K projects to.
        """
        if self._info_topic(LABELLED_CAMERA) in self._reader.topics:
            return _name(LABELLED_CAMERA)
        base = f"/{self._topics.vehicle}/"
        for topic in sorted(self._reader.topics):
            name = topic.removeprefix(base).removesuffix("/camera_info")
            if topic != self._topics.camera_info(name).name:
                continue
            first = next((message for _, message in self._reader.messages(topic)), None)
            is_plain = first is not None and first.distortion_model == "plumb_bob" and not any(first.d)
            if is_plain and self._topics.image_labels(name).name in self._reader.topics:
                return name
        return None

    def _carried(
        self, name: str, stamp_ns: int, occlusion: Mapping[str, float], points: Mapping[str, int]
    ) -> CameraAtFrame:
        """A camera of the vehicle's own, whose calibration stays; labels are None where it has no image."""
        _, info = next(iter(self._reader.messages(self._topics.camera_info(name).name)))
        message = self._message(self._topics.image_labels(name).name, stamp_ns)
        labels = None if message is None else image_labels_from_message(message)
        for raw in self._raw(TF.name, stamp_ns):
            self._truth.take(raw)
        lidar_SE3_camera = self._truth.lidar_SE3(info.header.frame_id, stamp_ns, self._lidar_frame)
        self._truth.forget_before(stamp_ns)
        matrix_P = np.asarray(info.p, np.float64).reshape(3, 4)
        calibration = KittiCalibration(dict.fromkeys(CAMERAS, matrix_P), np.eye(3), invert(lidar_SE3_camera))
        size_px = int(info.width), int(info.height)
        return CameraAtFrame(calibration, size_px, labels, occlusion, points)

    def _calibration(self, infos: Mapping[int, Any], stamp_ns: int) -> KittiCalibration:
        """The calibration from the mount of camera 2: camera 0 stands where its projection says."""
        for raw in self._raw(TF.name, stamp_ns):
            self._truth.take(raw)
        own = infos[LABELLED_CAMERA]
        rectification_R = np.asarray(own.r, np.float64).reshape(3, 3)
        matrix_P = np.asarray(own.p, np.float64).reshape(3, 4)
        centre = -np.linalg.solve(matrix_P[:, :3], matrix_P[:, 3])
        frame = self._topics.sensor_frame(_name(LABELLED_CAMERA))
        lidar_SE3_camera = self._truth.lidar_SE3(frame, stamp_ns, self._lidar_frame)
        camera0_SE3_camera = se3(np.eye(3), rectification_R.T @ centre)
        self._truth.forget_before(stamp_ns)
        return KittiCalibration(
            {camera: np.asarray(info.p, np.float64).reshape(3, 4) for camera, info in infos.items()},
            rectification_R,
            camera0_SE3_camera @ np.linalg.inv(lidar_SE3_camera),
        )

    def _info_topic(self, camera: int) -> str:
        return self._topics.camera_info(_name(camera)).name

    def _message(self, topic: str, stamp_ns: int) -> Any:
        for raw in self._raw(topic, stamp_ns):
            message = self._reader.decode(raw)
            if header_stamp_ns(message) == stamp_ns:
                return message
        return None

    def _raw(self, topic: str, stamp_ns: int) -> Any:
        if topic not in self._reader.topics:
            return ()
        return self._reader.raw_messages([topic], stamp_ns, stamp_ns)


def virtual_calibration() -> KittiCalibration:
    """All cameras in one place, ahead of the LiDAR and below it, looking forward."""
    camera_R_lidar = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    translation_m = -camera_R_lidar @ [_AHEAD_M, 0.0, -_BELOW_M]
    return KittiCalibration(dict.fromkeys(CAMERAS, _VIRTUAL_P), np.eye(3), se3(camera_R_lidar, translation_m))


def _name(camera: int) -> str:
    return f"camera_{camera}"
