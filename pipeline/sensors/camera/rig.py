"""The cameras of one instrumented vehicle, and their images in one step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.sensors.camera.daylight import Daylight, sun_direction
from advpipe.pipeline.sensors.camera.exposure import Exposure
from advpipe.pipeline.sensors.camera.image_boxes import ImageObject, image_objects
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.pipeline.sensors.camera.picture import Layers, Photographer, View
from advpipe.pipeline.sensors.camera.precipitation import draw_particles
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.camera.shading import Shading
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.pipeline.sensors.camera.surfaces import VisibleSurroundings
from advpipe.pipeline.sensors.camera.world_pictures import Picture, PicturingSurroundings
from advpipe.pipeline.sensors.lidar.sweep import mounting, poses_at
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant

Float32 = npt.NDArray[np.float32]

BASE_R_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From the axes of an optical frame (x right, y down, z forward) to those of a body (REP-103)."""

SKY_S = 60.0
"""How long a picture of the sky serves; the sun moves by a quarter of a degree meanwhile."""

BLURRED = 5
"""Exposures that a picture with motion blur averages."""


@dataclass(frozen=True)
class CameraView:
    """One camera's images at one instant. rgb: (H, W, 3) uint8, None where it records none. ids: of the road
    users to which the layers refer."""

    lens: Lens
    rgb: npt.NDArray[np.uint8] | None
    layers: Layers
    objects: tuple[ImageObject, ...]
    ids: tuple[str, ...]


class CameraRig:
    """The cameras of one vehicle, by name. mounts: base_SE3_camera, x forward, and base_SE3_optical."""

    def __init__(self, vehicle: str, sections: Mapping[str, CameraSensor], drive: DriveSettings) -> None:
        self._vehicle, self._sections, self._drive = vehicle, sections, drive
        self.mounts = {name: mounting(section) for name, section in sections.items()}
        self._photographers = {
            name: Photographer(section.lens(), section.range, section.samples)
            for name, section in sections.items()
        }
        self._exposures = {
            name: Exposure(section, named_generator(drive.seed, "camera", vehicle, name))
            for name, section in sections.items()
        }
        self._skies: tuple[int, Shading, SkyMap] | None = None

    def base_SE3_optical(self, name: str) -> Float64:
        """The pose of a camera's optical frame."""
        return self.mounts[name] @ se3(BASE_R_OPTICAL, (0, 0, 0))

    def look(self, instant: Instant) -> tuple[Mapping[str, CameraView], Boxes]:
        """The views of the cameras that are due, by name, and all road users in their range."""
        due = {
            name: section
            for name, section in self._sections.items()
            if instant.frame % round(section.sensor_tick / self._drive.step_s) == 0
        }
        if not due:
            return {}, Boxes()
        range_m = max(section.range for section in due.values())
        by_range = {each: instant.world.road_users(each) for each in {s.range for s in due.values()}}
        views = {
            name: self._view(name, section, instant, by_range[section.range]) for name, section in due.items()
        }
        return views, by_range[range_m]

    def _view(self, name: str, section: CameraSensor, instant: Instant, boxes: Boxes) -> CameraView:
        lens, map_SE3_base = self._photographers[name].lens, instant.motion.map_SE3_base
        if isinstance(instant.world, PicturingSurroundings):
            picture = instant.world.picture(name, boxes)
        else:
            picture = self._picture(name, section, instant, boxes)
        map_SE3_optical = map_SE3_base @ self.base_SE3_optical(name)
        objects = tuple(image_objects(boxes, picture.layers, lens, map_SE3_optical))
        return CameraView(lens, picture.rgb, picture.layers, objects, boxes.ids)

    def _picture(self, name: str, section: CameraSensor, instant: Instant, boxes: Boxes) -> Picture:
        world, motion = cast(VisibleSurroundings, instant.world), instant.motion
        photographer, optical = self._photographers[name], self.base_SE3_optical(name)
        view = View(motion.map_SE3_base @ optical, motion.map_SE3_base)
        has_colour = "rgb" in section.images
        shading, sky = self._light(instant.stamp_ns)
        radiance, layers = photographer.take(world, view, boxes.geometry, shading if has_colour else None)
        if radiance is None:
            return Picture(None, layers)
        exposure_s = section.motion_blur_intensity / section.shutter_speed
        twist = np.concatenate([motion.base_velocity_mps, motion.turn_rate_radps])
        if exposure_s:
            for time_s in np.linspace(-exposure_s, 0, BLURRED)[:-1]:
                map_SE3_base = motion.map_SE3_base @ poses_at(twist, np.array([time_s]))[0]
                earlier = View(map_SE3_base @ optical, map_SE3_base, float(time_s))
                more, _ = photographer.take(world, earlier, boxes.geometry, shading)
                radiance += more if more is not None else 0
            radiance /= np.float32(BLURRED)
        rng = named_generator(self._drive.seed, "camera", self._vehicle, name, instant.frame)
        map_R_optical = view.map_SE3_optical[:3, :3]
        draw_particles(
            radiance,
            photographer.lens,
            self._drive.weather,
            map_R_optical.T @ motion.velocity_mps,
            map_R_optical.T @ [0.0, 0.0, -1.0],
            1 / section.shutter_speed,
            sky.horizon,
            rng,
        )
        return Picture(self._exposures[name].develop(radiance, rng, photographer.workers), layers)

    def _light(self, stamp_ns: int) -> tuple[Shading, SkyMap]:
        """The light at a time; the sky's picture is made anew now and then."""
        slot = int(stamp_ns // int(SKY_S * 1e9))
        if self._skies is None or self._skies[0] != slot:
            sun = sun_direction(stamp_ns, self._drive.latitude_deg, self._drive.longitude_deg)
            sky = SkyMap(Daylight(sun, self._drive.weather), named_generator(self._drive.seed, "sky"))
            self._skies = slot, Shading(sky), sky
        return self._skies[1], self._skies[2]
