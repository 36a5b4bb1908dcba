"""Blinding: a strong light shines into the lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.image_quantities import IMAGE_DELAY, IMAGES_DROPPED, IMAGES_REPLACED
from advpipe.pipeline.sensors.camera.exposure import levels_of, signal_of
from advpipe.stages.attack.bounds import checked_integer, checked_number
from advpipe.stages.attack.camera.base import (
    AttackedImage,
    CameraAttack,
    CameraDrive,
    CameraImage,
    CameraTraits,
    ImageAttacker,
    ImageContext,
    whole_image,
)
from advpipe.stages.attack.camera.glare import Glare, Light
from advpipe.stages.attack.camera.scene_light import log_mean

EXPOSURE_SPEED = 0.35
"""Share of the way to the exposure that a picture needs which one image goes: the default of our cameras."""


@dataclass(frozen=True, kw_only=True)
class CameraBlind(CameraAttack):
    """A strong light shines into the lens. It makes a saturated disc with streaks, stray light over all of
    the image, and an exposure that follows, so that the rest grows dark (Petit et al., Remote attacks on
    automated vehicles sensors, Black Hat Europe 2015; glare after Spencer et al., SIGGRAPH 1995).

    Its brightness follows from the power, the beam and the air between. The default is a laser of an outdoor
    show, which have 10 to 25 W of white light (prolight.hr, Laser snaga i vidljivost), in a narrow beam. At
    noon it saturates 3.5 % of the first image and 1.6 % of later ones, and the veil hides road users from
    `small`. azimuth_deg: where the light stands from the camera's axis; positive is left. elevation_deg:
    positive is up. distance_m: of the light. power_w: radiant power of the beam, of white light.
    divergence_mrad: full angle of the beam. source_m: diameter of the light. scatter: stray light of the lens
    over that of a human eye. blades: of the lens' aperture, which make the streaks; 0 for none. camera: the
    name of the attacked one; all of the victim without a name.
    """

    traits = CameraTraits()

    azimuth_deg: float = 4.0
    elevation_deg: float = 1.0
    distance_m: float = 30.0
    power_w: float = 25.0
    divergence_mrad: float = 1.0
    source_m: float = 0.05
    scatter: float = 0.3
    blades: int = 6
    camera: str = ""

    def __post_init__(self) -> None:
        name = "camera-blind"
        checked_number(name, "azimuth_deg", self.azimuth_deg, -180, 180)
        checked_number(name, "elevation_deg", self.elevation_deg, -89, 89)
        checked_number(name, "distance_m", self.distance_m, 0.1, 1000)
        checked_number(name, "power_w", self.power_w, 1e-6, 1e4)
        checked_number(name, "divergence_mrad", self.divergence_mrad, 0.01, 2000)
        checked_number(name, "source_m", self.source_m, 0.001, 2)
        checked_number(name, "scatter", self.scatter, 0, 10)
        checked_integer(name, "blades", self.blades, 0, 24)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return dict.fromkeys((IMAGES_DROPPED.name, IMAGE_DELAY.name, IMAGES_REPLACED.name), (0, 0))

    @property
    def light(self) -> Light:
        """The light that blinds."""
        place = self.azimuth_deg, self.elevation_deg, self.distance_m
        return Light(*place, self.power_w, self.divergence_mrad, self.source_m)

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """No draws."""
        light = self.light
        glare = Glare(drive.lens(), light, self.blades, self.scatter)
        log_gain = 0.0

        def blind(image: CameraImage, context: ImageContext) -> AttackedImage:
            nonlocal log_gain
            log_gain = 0.0 if context.elapsed_s == 0 else log_gain
            around, before = drive.light.at(image.stamped.stamp_ns), signal_of(image.rgb())
            passed = float(around.transmittance(np.array(self.distance_m)))
            added = glare.luminance(light.illuminance_klx * passed)
            dazzled = before + added * np.float32(around.usual_exposure(before))
            log_gain += EXPOSURE_SPEED * (log_mean(before) - log_mean(dazzled) - log_gain)
            return whole_image(image.with_rgb(levels_of(dazzled * np.float32(np.exp(log_gain)))))

        return blind
