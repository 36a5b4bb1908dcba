"""An adversarial patch: a print on a vehicle's rear, by which a detector does not see the vehicle."""

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
from advpipe.stages.attack.camera.patch_place import PatchSize, candidates, optical_SE3_patch
from advpipe.stages.attack.camera.patch_print import PatchImage, printed
from advpipe.stages.attack.camera.patch_view import patch_view
from advpipe.stages.attack.camera.scene import CameraScene
from advpipe.stages.attack.camera.scene_light import SceneLight

PATTERNS = ("adversarial", "random", "random-best")

LEAST_PIXELS = 12
"""An image that shows less of the patch stays as it is."""

VIEWS, OFF_M, LARGER = 3, 0.02, 0.04
"""Displaced views of each image that the search looks at, and deviations of their place and size."""


@dataclass(frozen=True, kw_only=True)
class CameraPatch(CameraAttack):
    """A patch printed on the rear of a vehicle makes a detector overlook this vehicle. So did Thys et al.
    with persons (Fooling automated surveillance cameras, CVPR Workshops 2019).

    The patch is a rectangle on the rear plane of the vehicle's true box, seen through the camera's lens,
    behind what hides it, in the light and the air of the scene. One texture is sought for all images of the
    schedule and all attacked cameras, with expectation over small errors of print, place and exposure
    (Athalye et al., ICML 2018). It lies beside the bag as a PNG file.

    target: id of the vehicle; without one, the nearest whose rear the first attacked images show.
    width_m, height_m: of the print. center_m: height of its middle above the road. texel_m: side of one of
    its squares. pattern: adversarial, random (every square at random) or random-best (of `tries` random ones,
    the one under which the detector sees the vehicle least). image_detector: the attacked one, a name, a
    checkpoint or module:Class. steps: of the search. images: as many of the schedule as it looks at. tries:
    random patches of random-best. learning_rate: of the search (Adam). camera: the name of the attacked one;
    all of the victim without a name.
    """

    traits = CameraTraits(needs_scene=True)

    target: str = ""
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
        checked_number(name, "width_m", self.width_m, 0.05, 5)
        checked_number(name, "height_m", self.height_m, 0.05, 5)
        checked_number(name, "center_m", self.center_m, 0, 5)
        checked_number(name, "texel_m", self.texel_m, 0.005, 1)
        checked_choice(name, "pattern", self.pattern, PATTERNS)
        checked_integer(name, "steps", self.steps, 1, 100_000)
        checked_integer(name, "images", self.images, 1, 1000)
        checked_integer(name, "tries", self.tries, 1, 10_000)
        checked_number(name, "learning_rate", self.learning_rate, 1e-5, 10)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        none = dict.fromkeys((IMAGES_DROPPED.name, IMAGE_DELAY.name, IMAGES_REPLACED.name), (0.0, 0.0))
        return none | {PAINT_EXTENT.name: (0.0, math.hypot(self.width_m, self.height_m))}

    @property
    def image_detectors(self) -> tuple[str, ...]:
        return () if self.pattern == "random" else (self.image_detector,)

    @property
    def size(self) -> PatchSize:
        """Of the print."""
        return PatchSize(self.width_m, self.height_m, self.center_m)

    @property
    def texels(self) -> tuple[int, int]:
        """Rows and columns of the texture."""
        rows, columns = (max(round(each / self.texel_m), 1) for each in (self.height_m, self.width_m))
        return rows, columns

    def plan(self, rng: np.random.Generator, drives: Sequence[CameraDrive]) -> tuple[str, Float64]:
        """The vehicle and the texture (h w, 3); draws for this and its search."""
        target = self._vehicle(drives)
        texture = self._texture(rng, drives, target)
        drives[0].keep(f"patch_{target}", printed(texture, self.texels))
        return target, texture

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """No draws."""
        target, texture = drive.plan

        def paint(image: CameraImage, context: ImageContext) -> AttackedImage:
            scene, rgb = context.scene(), image.rgb()
            patch = self._in_image(image, scene, drive.light, target)
            if patch is None or len(patch.view.pixels) < LEAST_PIXELS:
                return AttackedImage(image)
            area = patch.area(rgb.shape[1], target)
            return AttackedImage(image.with_rgb(patch.paint(rgb, texture)), painted=area)

        return paint

    def _vehicle(self, drives: Sequence[CameraDrive]) -> str:
        """The target, or the nearest vehicle, in the first scheduled image that shows the rear of one; of the
        first camera that shows any."""
        for drive in drives:
            for image, scene in drive.scheduled():
                known = scene()
                for name in candidates(known, self.size):
                    patch = self._in_image(image, known, drive.light, name)
                    is_seen = patch is not None and len(patch.view.pixels) >= LEAST_PIXELS
                    if is_seen and self.target in ("", name):
                        return name
        topics = ", ".join(drive.camera.image_topic for drive in drives)
        raise UsageError(
            f"camera-patch: no image of {topics} in the schedule shows the rear of "
            f"{self.target or 'a vehicle'}; choose another target, schedule or camera"
        )

    def _in_image(
        self,
        image: CameraImage,
        scene: CameraScene,
        light: SceneLight,
        target: str,
        offset_m: tuple[float, float] = (0.0, 0.0),
        scale: float = 1.0,
    ) -> PatchImage | None:
        """The patch on its vehicle; None where the scene does not know this."""
        box = scene.box_of(target)
        if box is None:
            return None
        pose = optical_SE3_patch(scene, box, self.size)
        view = patch_view(scene, target, pose, self.size, self.texels, offset_m, scale)
        if view.is_empty:
            return None
        signal = signal_of(image.rgb())
        around = light.at(image.stamped.stamp_ns)
        lit = patch_light(scene, signal, around, target, pose, view.pixels)
        return PatchImage(view, lit, signal.reshape(-1, 3)[view.pixels])

    def _texture(self, rng: np.random.Generator, drives: Sequence[CameraDrive], target: str) -> Float64:
        from advpipe.pipeline.detector.threads import fixed_torch_threads
        from advpipe.pipeline.image_detector.registry import differentiable_image_detector
        from advpipe.stages.attack.camera.patch_search import (
            PatchExample,
            PatchExamples,
            best_random,
            optimised,
            random_texture,
        )

        if self.pattern == "random":
            return random_texture(rng, self.texels)
        detector = differentiable_image_detector(self.image_detector)
        found = []
        for drive in drives:
            for image, scene in self._chosen(drive):
                label = _label_of(scene, target, detector.classes, self.image_detector)
                views = self._displaced(rng, image, scene, drive.light, target)
                if views:
                    found.append(PatchExample(image.rgb(), views, _box_px(scene, target), label))
        if not found:
            raise UsageError(
                f"camera-patch: none of the images that the search looks at shows the rear of "
                f"{target}; raise images"
            )
        examples = PatchExamples(found, detector)
        with fixed_torch_threads():
            if self.pattern == "random-best":
                return best_random(examples, rng, self.texels, self.tries)
            return optimised(examples, rng, self.texels, self.steps, self.learning_rate)

    def _displaced(
        self,
        rng: np.random.Generator,
        image: CameraImage,
        scene: CameraScene,
        light: SceneLight,
        target: str,
    ) -> list[PatchImage]:
        """The patch where it is, and with small errors of its place and size; none where it is not seen."""
        true = self._in_image(image, scene, light, target)
        if true is None or len(true.view.pixels) < LEAST_PIXELS:
            return []
        views = [true]
        for right, down, larger in rng.normal(0, (OFF_M, OFF_M, LARGER), (VIEWS - 1, 3)).tolist():
            scale = float(np.exp(larger))
            moved = self._in_image(image, scene, light, target, (right, down), scale)
            views += [moved] if moved is not None else []
        return views

    def _chosen(self, drive: CameraDrive) -> Iterator[tuple[CameraImage, CameraScene]]:
        """As many images of the schedule as the search looks at, evenly spread."""
        count = sum(1 for _ in drive.scheduled())
        places = set(np.linspace(0, count - 1, min(self.images, count)).round().astype(int).tolist())
        for place, (image, scene) in enumerate(drive.scheduled()):
            if place in places:
                yield image, scene()


def _label_of(scene: CameraScene, target: str, classes: tuple[str, ...], detector: str) -> int:
    """The detector's label of the target, a car where the scene does not know it."""
    ids = scene.boxes.ids
    name = CLASSES[scene.boxes.labels[ids.index(target)]] if target in ids else CLASSES[0]
    if name not in classes:
        raise UsageError(f"camera-patch: {detector} detects no {name}, which {target} is")
    return classes.index(name)


def _box_px(scene: CameraScene, target: str) -> tuple[float, float, float, float]:
    """The edges of what is visible of the target."""
    rows, columns = np.nonzero(scene.pixels_of(target))
    if not len(rows):
        return (0.0, 0.0, 0.0, 0.0)
    return float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max())
