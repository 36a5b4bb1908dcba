"""The section of a camera in the scenario file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import DriveTimeS, MountingHeightM, MountingM, RangeM
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.section import (
    NotNegative,
    Number,
    Probability,
    Reference,
    Section,
    Whole,
)
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.sensors.camera.lens import LensError, lens_of
from advpipe.pipeline.sensors.camera.presets import CAMERA_PRESETS
from advpipe.pipeline.sensors.sensor import MountedSection

ImageKind = Literal["rgb", "depth", "semantic_segmentation", "instance_segmentation"]
"""The kinds of images, by the last part of the name of CARLA's blueprint."""

MAX_PIXELS = 12_600_000
"""Limit on the samples of one image, 4096 x 3072: each pixel needs some 100 bytes of memory."""

MAX_PINHOLE_FOV = 170.0
"""Beyond it, a pinhole camera spends most pixels on the edge of its image."""

FOV_DEG = 0.1
"""By how much fov may differ from that of the intrinsics given beside it."""

Coefficient = Annotated[Number, Field(ge=-100, le=100)]


class Intrinsics(Section):
    """The intrinsic parameters in pixels; the centre of the top left pixel is (0, 0)."""

    fx: Number = Field(ge=1, le=1e6, description="horizontal focal length")
    fy: Number = Field(ge=1, le=1e6, description="vertical focal length")
    cx: Number = Field(ge=-1e5, le=1e5, description="column of the principal point")
    cy: Number = Field(ge=-1e5, le=1e5, description="row of the principal point")


class CameraSensor(MountedSection):
    """A camera; keys have the names and meanings of CARLA's sensor.camera.* where it has them."""

    preset: Reference | None = Field(
        None,
        description=f"a known camera ({', '.join(CAMERA_PRESETS)}); other keys given here override it",
    )
    x_m: MountingM = Field(0.6, description="mounting position forward of the vehicle's centre")
    y_m: MountingM = Field(0.0, description="mounting position to the left of the vehicle's centre")
    z_m: MountingHeightM = Field(1.5, description="mounting height above the road")
    roll_deg: Number = Field(
        0.0, ge=-180, le=180, description="mounting roll; positive lowers the right side"
    )
    pitch_deg: Number = Field(0.0, ge=-90, le=90, description="mounting pitch; positive points down")
    yaw_deg: Number = Field(0.0, ge=-180, le=180, description="mounting yaw; positive turns to the left")
    images: tuple[ImageKind, ...] = Field(
        ("rgb",), min_length=1, max_length=4, description="the images that it records of each instant"
    )
    image_size_x: Whole = Field(800, ge=8, le=8192, description="width of the image in pixels")
    image_size_y: Whole = Field(600, ge=8, le=8192, description="height of the image in pixels")
    projection: Literal["pinhole", "fisheye"] = Field(
        "pinhole", description="pinhole, or fisheye: equidistant, the angle grows with the distance"
    )
    fov: Number = Field(90.0, ge=0.1, lt=360, description="horizontal field of view in degrees")
    intrinsics: Intrinsics | None = Field(None, description="in place of fov, which may repeat them")
    distortion: tuple[Coefficient, ...] = Field(
        (), max_length=5, description="k1, k2, p1, p2, k3 (plumb_bob) of a pinhole, k1 to k4 of a fisheye"
    )
    sensor_tick: DriveTimeS = Field(0.1, description="seconds between two images")
    range: RangeM = Field(150.0, description="range of the road users that it sees and that have 2D boxes")
    samples: Literal[1, 4] = Field(1, description="rays per pixel; with 1, pixels at edges have four")
    shutter_speed: Number = Field(200.0, ge=1, le=100_000, description="inverse of the exposure time in 1/s")
    iso: Number = Field(100.0, ge=25, le=102_400, description="gain of the sensor, which scales its noise")
    exposure_compensation: Number = Field(0.0, ge=-10, le=10, description="in stops, on top of auto-exposure")
    exposure_speed: Probability = Field(
        0.35, description="share of the way to the new exposure that one image goes; 1: all of it"
    )
    motion_blur_intensity: Probability = Field(
        0.0, description="share of the exposure time that blurs; 0: none"
    )
    noise: NotNegative = Field(1.0, le=100, description="factor on the sensor's noise; 0: none")
    jpeg_quality: Whole = Field(92, ge=1, le=100, description="quality of the JPEG files of rgb")

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, keys: Any) -> Any:
        """Add the keys of the preset; keys in the file take precedence."""
        if not isinstance(keys, dict) or not isinstance(keys.get("preset"), str):
            return keys
        name = keys["preset"]
        if name not in CAMERA_PRESETS:
            known = known_names(name, CAMERA_PRESETS)
            raise ValueError(f"preset {short_repr(name)} is unknown; {known}")
        preset = dict(CAMERA_PRESETS[name])
        for given, replaced in (("fov", "intrinsics"), ("intrinsics", "fov")):
            if given in keys and replaced not in keys:
                preset.pop(replaced, None)
        return preset | keys

    @model_validator(mode="after")
    def _image(self) -> CameraSensor:
        if len(set(self.images)) < len(self.images):
            raise ValueError("images names one kind twice")
        pixels = self.image_size_x * self.image_size_y
        if pixels * self.samples > MAX_PIXELS:
            raise ValueError(
                f"image_size_x {self.image_size_x} by image_size_y {self.image_size_y} with samples "
                f"{self.samples} needs {pixels * self.samples:,} rays, over {MAX_PIXELS:,}; lower them"
            )
        return self

    @model_validator(mode="after")
    def _intrinsics(self) -> CameraSensor:
        given, size = self.intrinsics, (self.image_size_x, self.image_size_y)
        if given is None:
            return self
        if not all(-0.5 <= at <= side - 0.5 for at, side in zip((given.cx, given.cy), size, strict=True)):
            raise ValueError(
                f"the principal point of intrinsics, cx {given.cx:g} and cy {given.cy:g}, is outside the "
                f"image of {size[0]} by {size[1]} pixels; give the intrinsics of this size"
            )
        is_resolved = self.model_fields_set >= type(self).model_fields.keys()  # it has the default fov, too
        fov = self._fov_of(given)
        if "fov" in self.model_fields_set and not is_resolved and abs(self.fov - fov) > FOV_DEG:
            raise ValueError(
                f"fov is {self.fov:g}, but intrinsics with fx {given.fx:g} have {fov:.1f} degrees in "
                f"{size[0]} pixels; leave one of them out"
            )
        return self

    def _fov_of(self, given: Intrinsics) -> float:
        """The horizontal field of view in degrees, about the middle of the image."""
        half = self.image_size_x / 2 / given.fx
        return math.degrees(2 * (half if self.projection == "fisheye" else math.atan(half)))

    @model_validator(mode="after")
    def _lens(self) -> CameraSensor:
        if self.projection == "pinhole" and self.intrinsics is None and self.fov > MAX_PINHOLE_FOV:
            raise ValueError(
                f"fov {self.fov:g} is over {MAX_PINHOLE_FOV:g}, the most of a pinhole; "
                "make projection fisheye"
            )
        if self.projection == "fisheye" and len(self.distortion) > 4:
            raise ValueError("distortion of a fisheye has four coefficients at most")
        try:
            self.lens().check()
        except LensError as error:
            raise ValueError(str(error)) from error
        return self

    def lens(self) -> Any:
        """The projection, a `Lens`."""
        size = self.image_size_x, self.image_size_y
        given = self.intrinsics
        if given is not None:
            matrix = np.array([[given.fx, 0, given.cx], [0, given.fy, given.cy], [0, 0, 1.0]])
        else:
            half_rad = math.radians(self.fov) / 2
            across = half_rad if self.projection == "fisheye" else math.tan(half_rad)
            focal = self.image_size_x / 2 / across
            centre = (self.image_size_x - 1) / 2, (self.image_size_y - 1) / 2
            matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]])
        return lens_of(self.projection, size, matrix, self.distortion)
