"""The records of nuScenes' tables, with the fields that an import reads."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from advpipe.pipeline.core.document import Count, Document, Number, ShortText
from advpipe.pipeline.geometry.transforms import Float64, se3_from_quaternion

Three = Annotated[list[Number], Field(min_length=3, max_length=3)]
Four = Annotated[list[Number], Field(min_length=4, max_length=4)]


class NamedRecord(Document):
    """A scene, category or attribute."""

    token: ShortText
    name: ShortText


class SensorRecord(Document):
    """A sensor; channel: such as LIDAR_TOP."""

    token: ShortText
    channel: ShortText


class PosedRecord(Document):
    """A pose of a sensor or a vehicle. translation: metres. rotation: quaternion w, x, y, z."""

    token: ShortText
    translation: Three
    rotation: Four

    def matrix(self) -> Float64:
        """The transform (4, 4) to the parent frame. Raises ValueError for a quaternion of length zero."""
        w, x, y, z = self.rotation
        return se3_from_quaternion([x, y, z, w], self.translation)

    def yaw_rad(self) -> float:
        """The heading of its x axis, as `yaw_of` its matrix; exact for a rotation about z alone."""
        w, x, y, z = self.rotation
        return float(np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z))


class MountRecord(PosedRecord):
    """A calibrated sensor: its pose on the vehicle."""

    sensor_token: ShortText


class SampleRecord(Document):
    """A key frame of a scene. timestamp: microseconds since 1970."""

    token: ShortText
    timestamp: Count


class SampleDataRecord(Document):
    """A sensor's measurement of a key frame; filename: relative to the data set's folder."""

    token: ShortText
    sample_token: ShortText
    ego_pose_token: ShortText
    calibrated_sensor_token: ShortText
    timestamp: Count
    filename: str


class AnnotationRecord(PosedRecord):
    """An object in a key frame, in the map's frame. size: width, length, height."""

    sample_token: ShortText
    instance_token: ShortText
    attribute_tokens: list[ShortText] = Field([])
    size: Three
    num_lidar_pts: Count = 0


class InstanceRecord(Document):
    """An object of a scene."""

    token: ShortText
    category_token: ShortText
