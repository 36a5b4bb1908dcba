"""The blueprints of the stand-in: a vehicle or a pedestrian for each body of advpipe's, and the sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.stages.simulate.bodies import Variant

BOOL, INT, FLOAT, STRING, COLOUR = range(1, 6)

BASE_TYPES = {
    "van": "van",
    "minibus": "van",
    "bus": "bus",
    "motorcycle": "motorcycle",
    "scooter": "motorcycle",
    "bicycle": "bicycle",
}
BY_LABEL = {"car": "car", "truck": "truck", "cyclist": "bicycle"}
TAGS = {"car": 14, "truck": 15, "van": 14, "bus": 16, "motorcycle": 18, "bicycle": 19, "walker": 12}
"""CARLA's object labels; a van is a car there."""

LIDAR = {
    "channels": 32,
    "range": 10.0,
    "points_per_second": 56000,
    "rotation_frequency": 10.0,
    "upper_fov": 10.0,
    "lower_fov": -30.0,
    "horizontal_fov": 360.0,
}
DROPOFF = {
    "atmosphere_attenuation_rate": 0.004,
    "dropoff_general_rate": 0.45,
    "dropoff_intensity_limit": 0.8,
    "dropoff_zero_intensity": 0.4,
    "noise_stddev": 0.0,
    "noise_seed": 0,
}
CAMERA = {
    "image_size_x": 800,
    "image_size_y": 600,
    "fov": 90.0,
    "lens_circle_falloff": 5.0,
    "lens_circle_multiplier": 0.0,
    "lens_k": -1.0,
    "lens_kcube": 0.0,
    "lens_x_size": 0.08,
    "lens_y_size": 0.08,
}
PHOTOGRAPHY = {
    "shutter_speed": 200.0,
    "iso": 100.0,
    "fstop": 1.4,
    "gamma": 2.2,
    "exposure_compensation": 0.0,
    "motion_blur_intensity": 0.45,
}
SENSORS: dict[str, dict[str, float]] = {
    "sensor.camera.rgb": {**CAMERA, **PHOTOGRAPHY},
    "sensor.camera.depth": CAMERA,
    "sensor.camera.semantic_segmentation": CAMERA,
    "sensor.camera.instance_segmentation": CAMERA,
    "sensor.other.radar": {
        "horizontal_fov": 30.0,
        "vertical_fov": 30.0,
        "range": 100.0,
        "points_per_second": 1500,
    },
    "sensor.lidar.ray_cast": {**LIDAR, **DROPOFF},
    "sensor.lidar.ray_cast_semantic": LIDAR,
    "sensor.other.gnss": {
        "noise_seed": 0,
        **{f"noise_{axis}_{what}": 0.0 for axis in ("lat", "lon", "alt") for what in ("stddev", "bias")},
    },
    "sensor.other.imu": {
        "noise_seed": 0,
        **{f"noise_{what}_{axis}": 0.0 for what in ("accel_stddev", "gyro_stddev") for axis in "xyz"},
        **{f"noise_gyro_bias_{axis}": 0.0 for axis in "xyz"},
    },
}
SENSOR_TYPES = {
    "sensor.camera.depth": 1,
    "sensor.other.gnss": 4,
    "sensor.other.imu": 5,
    "sensor.other.radar": 9,
    "sensor.lidar.ray_cast_semantic": 10,
    "sensor.lidar.ray_cast": 11,
    "sensor.camera.rgb": 13,
    "sensor.camera.semantic_segmentation": 14,
    "sensor.camera.instance_segmentation": 15,
}
"""The numbers of the types in 0.9.16's streams."""


class Library:
    """variants: the body of each blueprint of a vehicle or a pedestrian. base_types: of these."""

    def __init__(self, variants: Mapping[str, Variant]) -> None:
        self.variants: dict[str, Variant] = {}
        self.base_types: dict[str, str] = {}
        self._definitions: list[list[Any]] = []
        for name, variant in variants.items():
            label = variant.body.label
            if label == "pedestrian":
                blueprint, base = f"walker.pedestrian.{name.replace('.', '_')}", "walker"
                attributes = _walker()
            else:
                base = BASE_TYPES.get(variant.body.name, BY_LABEL[label])
                blueprint = f"vehicle.standin.{name.replace('.', '_')}"
                attributes = _vehicle(base)
            self.variants[blueprint], self.base_types[blueprint] = variant, base
            self._add(blueprint, attributes)
        for blueprint, numbers in SENSORS.items():
            own = [
                _attribute(name, INT if isinstance(value, int) else FLOAT, str(value))
                for name, value in numbers.items()
            ]
            self._add(
                blueprint,
                [_attribute("role_name", STRING, "front"), _attribute("sensor_tick", FLOAT, "0.0"), *own],
            )

    def definitions(self) -> list[list[Any]]:
        """number, id, tags, attributes of each blueprint."""
        return self._definitions

    def __contains__(self, blueprint: str) -> bool:
        return any(definition[1] == blueprint for definition in self._definitions)

    def _add(self, blueprint: str, attributes: list[list[Any]]) -> None:
        tags = ",".join(blueprint.split("."))
        self._definitions.append([len(self._definitions) + 1, blueprint, tags, attributes])


def _attribute(name: str, kind: int, value: str, *others: str, fixed: bool = False) -> list[Any]:
    """id, type, value, recommended values, whether it can be set, whether only to a recommended value."""
    return [name, kind, value, [] if fixed else [value, *others], not fixed, False]


def _vehicle(base: str) -> list[list[Any]]:
    wheels = "2" if base in ("motorcycle", "bicycle") else "4"
    return [
        _attribute("role_name", STRING, "autopilot", "scenario", "ego_vehicle"),
        _attribute("color", COLOUR, "17,37,103", "180,44,44"),
        _attribute("base_type", STRING, base, fixed=True),
        _attribute("number_of_wheels", INT, wheels, fixed=True),
        _attribute("generation", INT, "2", fixed=True),
    ]


def _walker() -> list[list[Any]]:
    return [
        _attribute("role_name", STRING, "pedestrian"),
        _attribute("is_invincible", BOOL, "true"),
        _attribute("speed", FLOAT, "0.0", "1.43", "2.55"),
        _attribute("age", STRING, "adult", fixed=True),
    ]
