"""The stand-in's cameras: advpipe's own pictures, in CARLA's encodings."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np
from actor import Actor
from geometry import matrix_of, mirrored

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import se3
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.camera.daylight import Daylight, sun_direction
from advpipe.pipeline.sensors.camera.exposure import Exposure
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.picture import Layers, Photographer, View
from advpipe.pipeline.sensors.camera.rig import BASE_R_OPTICAL
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.camera.shading import Shading
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

RANGE_M = 400.0
FARTHEST_M, DEPTH_STEPS = 1000.0, 256**3 - 1


class Cameras:
    """All cameras of a scenario's world, under the sun at its start; without noise, and exposed at once."""

    def __init__(self, world: RaycastWorld, scenario: Scenario) -> None:
        self._world = world
        origin, clock = scenario.map.origin, scenario.simulation
        sun = sun_direction(clock.stamp_ns(0), origin.latitude_deg, origin.longitude_deg)
        daylight = Daylight(sun, scenario.environment.weather)
        self._shading = Shading(SkyMap(daylight, named_generator(clock.seed, "sky")))
        self._photographers: dict[int, Photographer] = {}

    def picture(self, sensor: Actor, bodies: Sequence[Actor], further: int) -> bytes:
        """Width, height, field of view, and the pixels: blue, green, red, alpha.

        The carrier's own body is left out, as a camera within a body does not see it.
        """
        section = CameraSensor.model_validate(
            {
                "image_size_x": int(sensor.values["image_size_x"]),
                "image_size_y": int(sensor.values["image_size_y"]),
                "fov": float(sensor.values["fov"]),
                "exposure_compensation": float(sensor.values.get("exposure_compensation", 0.0)),
                "noise": 0.0,
            }
        )
        if sensor.id not in self._photographers:
            self._photographers[sensor.id] = Photographer(section.lens(), RANGE_M, 1)
        assert sensor.parent is not None
        users = {body.id: body.road_user(body.name) for body in bodies}
        carrier = users[sensor.parent.id]
        surroundings = self._world.around(carrier, list(users.values()))
        boxes = surroundings.road_users(RANGE_M)
        view = View(mirrored(matrix_of(sensor.pose)) @ se3(BASE_R_OPTICAL, (0, 0, 0)), carrier.map_SE3_base)
        is_rgb = sensor.blueprint.endswith("rgb")
        radiance, layers = self._photographers[sensor.id].take(
            surroundings, view, boxes.geometry, self._shading if is_rgb else None
        )
        if radiance is not None:
            rgb = Exposure(section, np.random.default_rng(0)).develop(radiance, np.random.default_rng(0))
        else:
            by_name = {user.id: number for number, user in users.items()}
            numbers = np.array([by_name.get(name, 0) + further for name in boxes.ids] + [min(users)])
            # What stands still has a number of Unreal's, which may be that of an actor: the last one.
            rgb = self._coded(sensor, layers, numbers).reshape(section.image_size_y, section.image_size_x, 3)
        pixels = np.full((*rgb.shape[:2], 4), 255, np.uint8)
        pixels[:, :, :3] = rgb[:, :, ::-1]
        return struct.pack("<IIf", section.image_size_x, section.image_size_y, section.fov) + pixels.tobytes()

    def _coded(self, sensor: Actor, layers: Layers, numbers: np.ndarray) -> np.ndarray:
        """Red, green and blue (P, 3) of depth, tags, or tags and numbers of actors."""
        if sensor.blueprint.endswith("depth"):
            lens = self._photographers[sensor.id].lens
            x, y = np.meshgrid(*(np.arange(size, dtype=np.float64) for size in lens.size_px))
            ahead = lens.directions(np.column_stack([x.ravel(), y.ravel()]))[:, 2]
            depth_m = np.minimum(layers.range_m.astype(np.float64) * ahead, FARTHEST_M)
            steps = np.rint(depth_m / FARTHEST_M * DEPTH_STEPS).astype(np.int64)
            return np.stack([steps & 255, steps >> 8 & 255, steps >> 16], axis=1).astype(np.uint8)
        coded = np.zeros((len(layers.tags), 3), np.uint8)
        coded[:, 0] = layers.tags
        if sensor.blueprint.endswith("instance_segmentation"):
            seen = np.where(layers.tags == TAG["Sky"], 0, numbers[layers.objects])
            coded[:, 1], coded[:, 2] = seen & 255, seen >> 8 & 255
        return coded
