"""A camera of CARLA's: its pictures, and the truth about them from a depth and an instance camera there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.sensors.camera.palette import PALETTE, TAG
from advpipe.pipeline.sensors.camera.picture import Layers
from advpipe.pipeline.sensors.camera.rig import BASE_R_OPTICAL
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.camera.world_pictures import Picture
from advpipe.pipeline.sensors.lidar.sweep import mounting
from advpipe.stages.simulate.world.carla.silhouettes import silhouettes

Int64 = npt.NDArray[np.int64]

RGB, DEPTH, SEMANTIC, INSTANCE = (
    f"sensor.camera.{kind}" for kind in ("rgb", "depth", "semantic_segmentation", "instance_segmentation")
)
TRUTH = (DEPTH, INSTANCE)
"""Mounted with every camera: 2D boxes come from them."""

FARTHEST_M = 1000.0
"""What CARLA's depth camera shows of the sky."""

DEPTH_STEPS = 256**3 - 1

ROAD_USERS = tuple(
    TAG[name] for name in ("Pedestrian", "Rider", "Car", "Truck", "Bus", "Train", "Motorcycle", "Bicycle")
)
"""Tags of what can be an actor; other pixels have Unreal's numbers, which mean nothing here."""

CENTRED_PX = 0.01

OWN_ELECTRONICS = ("noise", "exposure_speed", "samples")


def check_camera(place: str, section: CameraSensor) -> None:
    """Raise UsageError for settings that CARLA's cameras lack; a notice tells of those without effect."""
    if section.projection != "pinhole":
        raise UsageError(
            f"{place}.projection: CARLA has no {section.projection} cameras; make it pinhole, with "
            "a fov below 170"
        )
    if any(section.distortion):
        raise UsageError(
            f"{place}.distortion: CARLA's lens is no plumb_bob, and has no CameraInfo; leave distortion out"
        )
    given = section.intrinsics
    if given is not None:
        off_px = (
            given.fx - given.fy,
            given.cx - (section.image_size_x - 1) / 2,
            given.cy - (section.image_size_y - 1) / 2,
        )
        if max(map(abs, off_px)) > CENTRED_PX:
            raise UsageError(
                f"{place}.intrinsics: CARLA's cameras have square pixels and the principal point in the "
                "middle; give fov instead (also in place of preset kitti)"
            )
    for key in OWN_ELECTRONICS:
        if getattr(section, key) != CameraSensor.model_fields[key].default:
            notice(f"{place}.{key} has no effect: exposure and noise of the picture are CARLA's own")


class CarlaCamera:
    """How one camera of the scenario is set up in CARLA, and how its pictures are read.

    Each of CARLA's steps takes a picture; those that are due are read. attributes: by blueprint.
    """

    def __init__(self, section: CameraSensor, step_s: float) -> None:
        self._section, self._steps = section, round(section.sensor_tick / step_s)
        self.base_SE3_sensor: Float64 = mounting(section)
        self._lens = section.lens()
        focal_px = float(self._lens.matrix[0, 0])
        view = {
            "image_size_x": section.image_size_x,
            "image_size_y": section.image_size_y,
            "fov": math.degrees(2 * math.atan(section.image_size_x / 2 / focal_px)),
            "lens_k": 0.0,
            "lens_kcube": 0.0,
            "sensor_tick": 0.0,
        }
        exposure = {
            "shutter_speed": section.shutter_speed,
            "iso": section.iso,
            "exposure_compensation": section.exposure_compensation,
            "motion_blur_intensity": section.motion_blur_intensity,
        }
        blueprints = {f"sensor.camera.{kind}" for kind in section.images} | set(TRUTH)
        self.attributes: Mapping[str, Mapping[str, object]] = {
            each: {**view, **exposure} if each == RGB else view for each in sorted(blueprints)
        }
        width, height = self._lens.size_px
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        self._rays: Float64 = self._lens.directions(np.column_stack([x.ravel(), y.ravel()]))

    def is_due(self, frame: int) -> bool:
        """Whether a picture is taken at this frame of the drive."""
        return frame % self._steps == 0

    def picture(self, data: Mapping[str, Any], boxes: Boxes, actors: Int64, map_SE3_base: Float64) -> Picture:
        """The picture among road users whose boxes are in the map frame and whose actors have numbers (M,).

        data: the `carla.Image` of one frame by blueprint.
        """
        images = {blueprint: self._pixels(blueprint, image) for blueprint, image in data.items()}
        labels, instances = images.get(SEMANTIC, images[INSTANCE]), images[INSTANCE]
        tags = np.where(labels[:, 2] < len(PALETTE), labels[:, 2], 0).astype(np.uint8)
        range_m = self.range_m(images[DEPTH])
        objects = seen_objects(instances, actors)
        map_SE3_optical = map_SE3_base @ self.base_SE3_sensor @ se3(BASE_R_OPTICAL, (0, 0, 0))
        found = silhouettes(self._lens.size_px, self._rays, range_m, objects, boxes, map_SE3_optical)
        layers = Layers(range_m, tags, objects, *found)
        rgb = None
        if RGB in images:
            width, height = self._lens.size_px
            rgb = np.ascontiguousarray(images[RGB][:, 2::-1].reshape(height, width, 3))
        return Picture(rgb, layers)

    def range_m(self, pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Range (P,) along the rays of a depth image (P, 4); infinite in the sky."""
        steps = pixels[:, 2::-1].astype(np.int64) @ (1, 256, 65536)
        depth_m = steps * (FARTHEST_M / DEPTH_STEPS)
        range_m: npt.NDArray[np.float32] = np.where(
            steps < DEPTH_STEPS, depth_m / self._rays[:, 2], np.inf
        ).astype(np.float32)
        return range_m

    def _pixels(self, blueprint: str, image: Any) -> npt.NDArray[np.uint8]:
        """The pixels (P, 4) of a `carla.Image`: blue, green, red, alpha.

        Raises AdvpipeError for another size.
        """
        width, height = self._lens.size_px
        if (image.width, image.height) != (width, height):
            raise AdvpipeError(
                f"CARLA's {blueprint} sends {image.width} x {image.height} pixels, not {width} x {height}"
            )
        return np.frombuffer(image.raw_data, np.uint8).reshape(-1, 4)


def seen_objects(instances: npt.NDArray[np.uint8], actors: Int64) -> npt.NDArray[np.int32]:
    """Which of M road users each pixel (P, 4) of an instance image shows; -1 for none (P,).

    actors: (M,) numbers of the road users' actors, of which green and blue are the low and the high byte.
    """
    numbers = instances[:, 1].astype(np.int64) + 256 * instances[:, 0].astype(np.int64)
    index_of = np.full(1 << 16, -1, np.int32)
    index_of[actors & 0xFFFF] = np.arange(len(actors))
    seen: npt.NDArray[np.int32] = np.where(
        np.isin(instances[:, 2], ROAD_USERS), index_of[numbers], np.int32(-1)
    )
    return seen
