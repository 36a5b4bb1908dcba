"""Messages of cameras: compressed images, calibration, 2D boxes, and the names of instances."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.build import message_header
from advpipe.pipeline.messages.types import message_class

Box2D = tuple[int, int, int, int]
"""First and last column and row: left, top, right, bottom."""

MOST_PIXELS = 1 << 26
"""Limit on a picture that is read: it comes from a bag."""


def jpeg_message(stamp_ns: int, frame_id: str, rgb: npt.NDArray[np.uint8], quality: int) -> Any:
    """sensor_msgs/CompressedImage of an image (H, W, 3), in the format of compressed_image_transport."""
    return _compressed(
        stamp_ns, frame_id, "rgb8; jpeg compressed bgr8", _encoded(rgb, "JPEG", quality=quality)
    )


def png_message(stamp_ns: int, frame_id: str, image: npt.NDArray[Any]) -> Any:
    """The same of an image (H, W, 3) of uint8 or (H, W) of uint16, without loss.

    compressed_image_transport writes the encoding, then the codec, then the colours in the file.
    """
    kind = "rgb8; png compressed bgr8" if image.ndim == 3 else "16UC1; png compressed "
    return _compressed(stamp_ns, frame_id, kind, _encoded(image, "PNG", compress_level=1))


def _compressed(stamp_ns: int, frame_id: str, kind: str, data: bytes) -> Any:
    return message_class("sensor_msgs/msg/CompressedImage")(
        header=message_header(stamp_ns, frame_id), format=kind, data=np.frombuffer(data, np.uint8)
    )


def _encoded(image: npt.NDArray[Any], codec: str, **options: int) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(image).save(file, codec, **options)
    return file.getvalue()


def decoded_rgb(data: bytes) -> npt.NDArray[np.uint8]:
    """The colours (H, W, 3) of a JPEG or PNG file. Raises ValueError, saying what it is, for another one."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=["JPEG", "PNG"]) as image:
            width, height = image.size
            if width * height > MOST_PIXELS:
                raise ValueError(f"has {width} x {height} pixels, over {MOST_PIXELS:,}")
            return np.asarray(image.convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError):
        raise ValueError("is not a complete JPEG or PNG file") from None


def camera_info_message(
    stamp_ns: int,
    frame_id: str,
    size_px: tuple[int, int],
    matrix: npt.NDArray[np.float64],
    model: str,
    distortion: Sequence[float],
) -> Any:
    """sensor_msgs/CameraInfo of a camera with matrix K (3, 3), which is also the projection P."""
    width, height = size_px
    projection = np.zeros((3, 4))
    projection[:, :3] = matrix
    return message_class("sensor_msgs/msg/CameraInfo")(
        header=message_header(stamp_ns, frame_id),
        height=height,
        width=width,
        distortion_model=model,
        d=np.array(distortion, np.float64),
        k=matrix.ravel().astype(np.float64),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
        binning_x=0,
        binning_y=0,
        roi=message_class("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False),
    )


def image_boxes_message(stamp_ns: int, frame_id: str, boxes: Sequence[tuple[str, str, float, Box2D]]) -> Any:
    """vision_msgs/Detection2DArray of boxes with id, class, score and edges; a box covers whole pixels."""
    header = message_header(stamp_ns, frame_id)
    return message_class("vision_msgs/msg/Detection2DArray")(
        header=header, detections=[_detection(header, *each) for each in boxes]
    )


def _detection(header: Any, name: str, class_name: str, score: float, edges: Box2D) -> Any:
    left, top, right, bottom = edges
    point = message_class("vision_msgs/msg/Point2D")((left + right) / 2, (top + bottom) / 2)
    centre = message_class("vision_msgs/msg/Pose2D")(position=point, theta=0.0)
    hypothesis = message_class("vision_msgs/msg/ObjectHypothesis")(class_id=class_name, score=score)
    return message_class("vision_msgs/msg/Detection2D")(
        header=header,
        results=[
            message_class("vision_msgs/msg/ObjectHypothesisWithPose")(hypothesis=hypothesis, pose=_no_pose())
        ],
        bbox=message_class("vision_msgs/msg/BoundingBox2D")(
            center=centre, size_x=float(right - left + 1), size_y=float(bottom - top + 1)
        ),
        id=name,
    )


def _no_pose() -> Any:
    point = message_class("geometry_msgs/msg/Point")(0.0, 0.0, 0.0)
    turn = message_class("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)
    pose = message_class("geometry_msgs/msg/Pose")(position=point, orientation=turn)
    return message_class("geometry_msgs/msg/PoseWithCovariance")(pose=pose, covariance=np.zeros(36))


def label_info_message(stamp_ns: int, frame_id: str, names: Mapping[int, str]) -> Any:
    """vision_msgs/LabelInfo: the names of the ids in a segmentation."""
    kind = message_class("vision_msgs/msg/VisionClass")
    return message_class("vision_msgs/msg/LabelInfo")(
        header=message_header(stamp_ns, frame_id),
        class_map=[kind(class_id=each, class_name=name) for each, name in sorted(names.items())],
        threshold=0.0,
    )
