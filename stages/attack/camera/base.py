"""The base of attacks on cameras: they change, replace, delay or drop the images of a camera."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from advpipe.pipeline.bag.recorded_cameras import RecordedCamera
from advpipe.pipeline.labels.image_quantities import IMAGE_QUANTITIES
from advpipe.pipeline.messages.compressed_image import StampedImage, UInt8, encoded_like, pixels_of
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.stages.attack.base import Attack, Traits
from advpipe.stages.attack.camera.scene import CameraScene
from advpipe.stages.attack.camera.scene_light import SceneLight


@dataclass(frozen=True)
class CameraImage:
    """An image on its way from the camera. number: of the clean image that it shows, counted on its topic."""

    stamped: StampedImage
    number: int

    def rgb(self) -> UInt8:
        """Its pixels (H, W, 3)."""
        return pixels_of(self.stamped.file)

    def with_rgb(self, rgb: UInt8) -> CameraImage:
        """With other pixels (H, W, 3), compressed as it is itself."""
        file = encoded_like(rgb, self.stamped.file)
        return replace(self, stamped=replace(self.stamped, file=file))


@dataclass(frozen=True)
class PaintedArea:
    """Where an image was painted on. edges_px: first and last column and row: left, top, right, bottom.
    pixels: how many in there. target: the road user that they belong to, "" for none."""

    edges_px: tuple[int, int, int, int]
    pixels: int
    target: str = ""


@dataclass(frozen=True)
class AttackedImage:
    """What becomes of one image: None if it never arrives."""

    image: CameraImage | None
    delay_ns: int = 0
    painted: PaintedArea | None = None


@dataclass(frozen=True)
class ImageContext:
    """One image under attack. elapsed_s: since the first attacked image of this span. previous: the last
    image that left this attack; None before the first. scene: what is known of its pixels, for attacks whose
    traits have `needs_scene`."""

    elapsed_s: float
    previous: CameraImage | None
    scene: Callable[[], CameraScene]


class CameraDrive(Protocol):
    """One attacked camera over its drive."""

    @property
    def camera(self) -> RecordedCamera:
        """Which one."""

    @property
    def light(self) -> SceneLight:
        """The light of the scenes, from the scenario in the bag."""

    @property
    def plan(self) -> Any:
        """What `CameraAttack.plan` made for all cameras of the attack."""

    def lens(self) -> Lens:
        """Its projection. Raises AdvpipeError for a bag that does not tell it."""

    def scheduled(self) -> Iterator[tuple[CameraImage, Callable[[], CameraScene]]]:
        """The clean images that the attack will act on, in order, each with a function that tells what is
        known of its pixels, until the next one is asked for.

        Raises AdvpipeError in a bag without depth, instances or true boxes.
        """

    def keep(self, name: str, rgb: UInt8) -> None:
        """Leave a picture (H, W, 3) beside the bag, as camera_NAME.png, such as what to print."""


ImageAttacker = Callable[[CameraImage, ImageContext], AttackedImage]
"""Changes one image; called for each attacked image of one camera in order."""


@dataclass(frozen=True, kw_only=True)
class CameraTraits(Traits):
    """Properties of an attack on cameras that do not depend on its parameters.

    needs_scene: whether it asks what is known of pixels (`ImageContext.scene`, `CameraDrive.scheduled`): its
    bags record depth, instances and true boxes.
    """

    needs_scene: bool = False


class CameraAttack(Attack):
    """An attack on the main images of a victim's cameras. Its constructor takes and checks keyword-only
    parameters, with defaults and units in their names; `camera` is the name of the attacked one, "" for all
    of the victim.

    >>> class Mirror(CameraAttack):
    ...     traits = CameraTraits()
    ...
    ...     def __init__(self, *, camera: str = "") -> None:
    ...         self.camera = camera
    ...
    ...     def begin(self, rng, drive):
    ...         return lambda image, context: whole_image(image.with_rgb(image.rgb()[:, ::-1].copy()))

    `bounds` are the limits that it keeps: an image beyond them is refused, and `verify` measures them again.
    """

    family = "camera"
    family_title = "Camera: paint on, blind, drop, freeze or delay the images of a vehicle's cameras"
    usual_options = "--victim ego"
    traits_type = CameraTraits
    quantities = IMAGE_QUANTITIES
    camera: str = ""

    @property
    @abstractmethod
    def traits(self) -> CameraTraits: ...

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each quantity that the attack bounds, in every attacked image, by names of
        `advpipe.pipeline.labels.image_quantities`; empty if it bounds none."""
        return {}

    @property
    def image_detectors(self) -> tuple[str, ...]:
        """The names of the image detectors that it attacks; their checksums go into the bag's record."""
        return ()

    def plan(self, rng: np.random.Generator, drives: Sequence[CameraDrive]) -> Any:
        """What all cameras of the attack share, such as a print: made once, in `drive.plan` later."""
        return None

    @abstractmethod
    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """Start the attack on one camera; all random draws come from `rng`."""


def whole_image(image: CameraImage) -> AttackedImage:
    """An image that was painted all over."""
    height, width = image.rgb().shape[:2]
    return AttackedImage(image, painted=PaintedArea((0, 0, width - 1, height - 1), width * height))
