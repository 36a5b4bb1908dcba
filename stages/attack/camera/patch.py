"""An adversarial patch: a print that hides the vehicle that it is on, or makes a sign look like a person."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.image_quantities import (
    IMAGE_DELAY,
    IMAGES_DROPPED,
    IMAGES_REPLACED,
    PAINT_EXTENT,
)
from advpipe.pipeline.sensors.camera.exposure import signal_of
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.camera.base import (
    AttackedImage,
    CameraAttack,
    CameraDrive,
    CameraImage,
    CameraTraits,
    ImageAttacker,
    ImageContext,
)
from advpipe.stages.attack.camera.patch_light import patch_light
from advpipe.stages.attack.camera.patch_place import Carrier, PatchSize, VehicleRear, vehicles_ahead
from advpipe.stages.attack.camera.patch_print import PatchImage, printed
from advpipe.stages.attack.camera.patch_view import patch_view
from advpipe.stages.attack.camera.scene import CameraScene
from advpipe.stages.attack.camera.scene_light import SceneLight

PATTERNS = ("adversarial", "random", "random-best")

VEHICLE, SIGN = SURFACES = ("vehicle", "sign")

LEAST_PIXELS = 12
"""An image that shows less of the patch stays as it is."""

LARGE_PX, COMPARED = 50, 30
"""Pixels of the patch that an image shows at least on a vehicle that nobody named, in the mean of those that
show it; and how many images of the schedule are looked at to choose it."""

VIEWS, OFF_M, LARGER = 3, 0.02, 0.04
"""Displaced views of each image that the search looks at, and deviations of their place and size."""


@dataclass(frozen=True)
class _Print:
    """What all cameras see. texture: (h w, 3) of `texels` (rows, columns)."""

    carrier: Carrier
    texels: tuple[int, int]
    texture: Float64


@dataclass(frozen=True, kw_only=True)
class CameraPatch(CameraAttack):
    """A patch printed on the rear of a vehicle makes a detector overlook this vehicle. So did Thys et al.
    with persons (Fooling automated surveillance cameras, CVPR Workshops 2019).

    The patch is a rectangle on the rear plane of the vehicle's true box, seen through the camera's lens,
    behind what hides it, in the light and the air of the scene. One texture is sought for all images of the
    schedule and all attacked cameras, with expectation over small errors of print, place and exposure
    (Athalye et al., ICML 2018). It lies beside the bag as a PNG file.

    surface: vehicle, or sign: the largest road sign in the first image with one, on which the patch makes
    the detector see a road user where none is. target: id of the vehicle; without one, that on which the
    images of the schedule show most of the patch. shown: the class to be seen on a sign. width_m, height_m:
    of the print; it is smaller on a smaller sign. center_m: height of its middle above the road, on a
    vehicle. texel_m: side of one of its squares. pattern: adversarial, random (every square at random) or
    random-best (of `tries` random ones, the one that comes nearest to the aim). image_detector: the attacked
    one, a name, a checkpoint or module:Class. steps: of the search. images: as many of the schedule as it
    looks at. tries: random patches of random-best. learning_rate: of the search (Adam). camera: the name of
    the attacked one; all of the victim without a name.
    """

    traits = CameraTraits(needs_scene=True)

    surface: str = VEHICLE
    target: str = ""
    shown: str = "pedestrian"
    width_m: float = 1.2
    height_m: float = 0.7
    center_m: float = 0.85
    texel_m: float = 0.05
    pattern: str = "adversarial"
    image_detector: str = "small"
    steps: int = 200
    images: int = 6
    tries: int = 10
    learning_rate: float = 0.05
    camera: str = ""

    def __post_init__(self) -> None:
        name = "camera-patch"
        checked_choice(name, "surface", self.surface, SURFACES)
        checked_choice(name, "shown", self.shown, CLASSES)
        checked_number(name, "width_m", self.width_m, 0.05, 5)
        checked_number(name, "height_m", self.height_m, 0.05, 5)
        checked_number(name, "center_m", self.center_m, 0, 5)
        checked_number(name, "texel_m", self.texel_m, 0.005, 1)
        checked_choice(name, "pattern", self.pattern, PATTERNS)
        checked_integer(name, "steps", self.steps, 1, 100_000)
        checked_integer(name, "images", self.images, 1, 1000)
        checked_integer(name, "tries", self.tries, 1, 10_000)
        checked_number(name, "learning_rate", self.learning_rate, 1e-5, 10)
        if self.surface == SIGN and self.target:
            raise UsageError(f"{name}: target is of a vehicle; leave it out, or make surface {VEHICLE}")

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        none = dict.fromkeys((IMAGES_DROPPED.name, IMAGE_DELAY.name, IMAGES_REPLACED.name), (0.0, 0.0))
        return none | {PAINT_EXTENT.name: (0.0, math.hypot(self.width_m, self.height_m))}

    @property
    def image_detectors(self) -> tuple[str, ...]:
        return () if self.pattern == "random" else (self.image_detector,)

    def plan(self, rng: np.random.Generator, drives: Sequence[CameraDrive]) -> _Print:
        """The print; draws for its texture and the search for it."""
        carrier = self._carrier(drives)
        size = carrier.size.height_m, carrier.size.width_m
        rows, columns = (max(round(each / self.texel_m), 1) for each in size)
        texture = self._texture(rng, drives, carrier, (rows, columns))
        drives[0].keep(f"patch_{carrier.name or SIGN}", printed(texture, (rows, columns)))
        return _Print(carrier, (rows, columns), texture)

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """No draws."""
        found: _Print = drive.plan

        def paint(image: CameraImage, context: ImageContext) -> AttackedImage:
            rgb = image.rgb()
            patch = _in_image(image, context.scene(), drive.light, found.carrier, found.texels)
            if patch is None:
                return AttackedImage(image)
            area = patch.area(rgb.shape[1], found.carrier.name)
            return AttackedImage(image.with_rgb(patch.paint(rgb, found.texture)), painted=area)

        return paint

    def _carrier(self, drives: Sequence[CameraDrive]) -> Carrier:
        """What a patch is fixed to: the named vehicle or a sign in the first image that shows one; without a
        name, the vehicle on which most of the patch is seen."""
        size = PatchSize(self.width_m, self.height_m)
        if self.surface == VEHICLE and not self.target:
            return self._largest(drives, size)
        for drive in drives:
            for image, scene in drive.scheduled():
                known, options = scene(), list[Carrier]()
                if self.surface == SIGN:
                    from advpipe.stages.attack.camera.patch_sign import signs

                    options += signs(known, size)
                else:
                    ahead = vehicles_ahead(known, size, self.center_m)
                    options += [each for each in ahead if each.name == self.target]
                for each in options:
                    if _in_image(image, known, drive.light, each, (1, 1)) is not None:
                        return each
        what = f"the rear of {self.target}"
        if self.surface == SIGN:
            what = "a road sign that is upright, flat and near enough to fix a patch to it"
        raise UsageError(
            f"camera-patch: no image of {_topics(drives)} in the schedule shows {what}; "
            "choose another target, schedule or camera"
        )

    def _largest(self, drives: Sequence[CameraDrive], size: PatchSize) -> Carrier:
        """The vehicle on which images, evenly spread over the schedule, show most of the patch."""
        seen_px = dict[str, list[float]]()
        for drive in drives:
            for _, scene in _spread(drive, COMPARED):
                for each in vehicles_ahead(scene, size, self.center_m):
                    view = patch_view(scene, each, (1, 1))
                    if len(view.pixels) >= LEAST_PIXELS:
                        seen_px.setdefault(each.name, []).append(float(view.cover.sum()))
        mean_px = {name: float(np.mean(each)) for name, each in seen_px.items()}
        large = [name for name in mean_px if mean_px[name] >= LARGE_PX]
        if not large:
            name = max(mean_px, key=mean_px.__getitem__, default="")
            most = f"at most {mean_px[name]:.0f} pixels, on {name}" if name else "none"
            raise UsageError(
                f"camera-patch: of a patch on the rear of a vehicle, the images of {_topics(drives)} in the "
                f"schedule show {most}; at least {LARGE_PX} are needed: give a target, a larger width_m and "
                "height_m, or another schedule or camera"
            )
        return VehicleRear(max(large, key=lambda each: sum(seen_px[each])), size, self.center_m)

    def _texture(
        self,
        rng: np.random.Generator,
        drives: Sequence[CameraDrive],
        carrier: Carrier,
        texels: tuple[int, int],
    ) -> Float64:
        from advpipe.pipeline.detector.threads import fixed_torch_threads
        from advpipe.pipeline.image_detector.registry import differentiable_image_detector
        from advpipe.stages.attack.camera.patch_search import (
            PatchExample,
            PatchExamples,
            best_random,
            optimised,
            random_texture,
        )

        # Of its own, so that all patterns begin with the same random texture.
        texture_rng = np.random.default_rng(rng.integers(2**63))
        if self.pattern == "random":
            return random_texture(texture_rng, texels)
        detector, found = differentiable_image_detector(self.image_detector), []
        for drive in drives:
            for image, scene in _spread(drive, self.images):
                if views := _displaced(rng, image, scene, drive.light, carrier, texels):
                    label = self._label(scene, carrier, detector.classes)
                    box_px = _box_px(scene, carrier, views[0])
                    found.append(PatchExample(image.rgb(), views, box_px, label))
        if not found:
            raise UsageError(
                "camera-patch: none of the images that the search looks at shows what the patch is fixed to; "
                "raise images"
            )
        examples = PatchExamples(found, detector, hides=self.surface == VEHICLE)
        with fixed_torch_threads():
            if self.pattern == "random-best":
                return best_random(examples, texture_rng, texels, self.tries)
            return optimised(examples, texture_rng, texels, self.steps, self.learning_rate)

    def _label(self, scene: CameraScene, carrier: Carrier, classes: tuple[str, ...]) -> int:
        """The detector's label of the vehicle, or of what a sign shall be taken for."""
        name, ids = self.shown, scene.boxes.ids
        if carrier.name in ids:
            name = CLASSES[scene.boxes.labels[ids.index(carrier.name)]]
        if name not in classes:
            raise UsageError(f"camera-patch: {self.image_detector} detects no {name}; it detects {classes}")
        return classes.index(name)


def _spread(drive: CameraDrive, most: int) -> Iterator[tuple[CameraImage, CameraScene]]:
    """At most so many images of the schedule, evenly spread."""
    count = sum(1 for _ in drive.scheduled())
    places = set(np.linspace(0, count - 1, min(most, count)).round().astype(int).tolist())
    for place, (image, scene) in enumerate(drive.scheduled()):
        if place in places:
            yield image, scene()


def _topics(drives: Sequence[CameraDrive]) -> str:
    return ", ".join(drive.camera.image_topic for drive in drives)


def _in_image(
    image: CameraImage,
    scene: CameraScene,
    light: SceneLight,
    carrier: Carrier,
    texels: tuple[int, int],
    offset_m: tuple[float, float] = (0.0, 0.0),
    scale: float = 1.0,
) -> PatchImage | None:
    """The patch in an image; None where this shows too little of it."""
    pose = carrier.optical_SE3_patch(scene)
    view = patch_view(scene, carrier, texels, offset_m, scale)
    if pose is None or len(view.pixels) < LEAST_PIXELS:
        return None
    signal, around = signal_of(image.rgb()), light.at(image.stamped.stamp_ns)
    lit = patch_light(scene, signal, around, carrier.own(scene), pose, view.pixels)
    return PatchImage(view, lit, signal.reshape(-1, 3)[view.pixels])


def _displaced(
    rng: np.random.Generator,
    image: CameraImage,
    scene: CameraScene,
    light: SceneLight,
    carrier: Carrier,
    texels: tuple[int, int],
) -> list[PatchImage]:
    """The patch where it is, and with small errors of its place and size; none where it is not seen."""
    true = _in_image(image, scene, light, carrier, texels)
    if true is None:
        return []
    views = [true]
    for right, down, larger in rng.normal(0, (OFF_M, OFF_M, LARGER), (VIEWS - 1, 3)).tolist():
        moved = _in_image(image, scene, light, carrier, texels, (right, down), float(np.exp(larger)))
        views += [moved] if moved is not None else []
    return views


def _box_px(scene: CameraScene, carrier: Carrier, patch: PatchImage) -> tuple[float, float, float, float]:
    """The edges of what is visible of the vehicle, or of the patch on a sign."""
    rows, columns = np.nonzero(scene.pixels_of(carrier.name))
    if not carrier.name:
        rows, columns = np.divmod(patch.view.pixels, scene.users.shape[1])
    return float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max())
