"""The search for the texture of a patch: Adam on what a detector says of the object there, over several
images and small errors of printing, mounting and exposure (expectation over transformations, Athalye et al.
2018)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.image_detector.protocol import DifferentiableImageDetector
from advpipe.pipeline.messages.compressed_image import UInt8
from advpipe.pipeline.sensors.camera.exposure import WHITE as WHITE_SIGNAL
from advpipe.pipeline.sensors.camera.exposure import curve
from advpipe.stages.attack.camera.patch_print import BLACK, WHITE, PatchImage

BRIGHTER, CONTRAST, NOISE = 0.08, 0.1, 0.015
"""Deviations of exposure, print contrast and noise of the random errors, as shares."""

ROUGHNESS = 0.05
"""Weight of the total variation, which printers and distance blur."""


@dataclass(frozen=True)
class PatchExample:
    """One image that the search looks at. views: of the patch, each displaced a little. box_px: of the
    object there, left, top, right, bottom; label: its class, as the detector counts."""

    rgb: UInt8
    views: Sequence[PatchImage]
    box_px: tuple[float, float, float, float]
    label: int


class PatchExamples:
    """Asks the detector about the object in each of several images with a texture. hides: whether the object
    shall not be detected, or else be detected where none is."""

    def __init__(
        self, examples: Sequence[PatchExample], detector: DifferentiableImageDetector, hides: bool = True
    ) -> None:
        self.examples, self._detector, self._hides = examples, detector, hides
        self._curve = torch.from_numpy(curve() / 255).float()

    def missed(
        self,
        texture: Tensor,
        example: PatchExample,
        view: PatchImage,
        gain: float = 1.0,
        noise: Tensor | float = 0.0,
    ) -> Tensor:
        """How far an attack with a texture (h w, 3) is from its aim, a scalar: how surely the object of an
        example is detected, or is not.

        gain: on the exposure. noise: what is added to the levels (P, 3) of the patch, 1 being white.
        """
        height, width = example.rgb.shape[:2]
        painted = self.painted(texture, view) * gain
        place = torch.sqrt((painted / WHITE_SIGNAL).clamp(1e-8, 1)) * (len(self._curve) - 1)
        low = place.detach().floor().long().clamp(max=len(self._curve) - 2)
        levels = self._curve[low] + (self._curve[low + 1] - self._curve[low]) * (place - low)
        levels = (levels + noise).clamp(0, 1)
        image = torch.from_numpy(example.rgb.reshape(-1, 3).astype(np.float32) / 255)
        image = image.index_put((torch.from_numpy(view.view.pixels),), levels)
        found = self._detector.objectness(
            image.reshape(height, width, 3).permute(2, 0, 1),
            torch.tensor([example.box_px], dtype=torch.float32),
            torch.tensor([example.label]),
        )
        return found[0] if self._hides else 1 - found[0]

    def painted(self, texture: Tensor, image: PatchImage) -> Tensor:
        """The signal (P, 3) of a patch's pixels, as `PatchImage.painted` computes it."""
        linear = torch.where(texture > 0.04045, ((texture + 0.055) / 1.055) ** 2.4, texture / 12.92)
        printed = BLACK + (WHITE - BLACK) * linear
        view = image.view
        weighted = torch.from_numpy(view.weights).float()[:, None] * printed[torch.from_numpy(view.texels)]
        mixed = torch.zeros(len(view.pixels), 3).index_add(0, torch.from_numpy(view.rows), weighted)
        cover = torch.from_numpy(view.cover).float()[:, None]
        white, air = (torch.from_numpy(each).float() for each in (image.light.white, image.light.air))
        return torch.from_numpy(image.signal) * (1 - cover) + mixed * white + cover * air

    def mean(self, texture: Float64) -> float:
        """The mean of `missed` over all images, without errors."""
        fixed = torch.from_numpy(texture).float()
        with torch.no_grad():
            return float(np.mean([float(self.missed(fixed, each, each.views[0])) for each in self.examples]))


def random_texture(rng: np.random.Generator, texels: tuple[int, int]) -> Float64:
    """A texture (h w, 3), uniform in every texel."""
    return rng.random((texels[0] * texels[1], 3))


def best_random(
    examples: PatchExamples, rng: np.random.Generator, texels: tuple[int, int], tries: int
) -> Float64:
    """The best of several random textures."""
    textures = [random_texture(rng, texels) for _ in range(tries)]
    return min(textures, key=examples.mean)


def optimised(
    examples: PatchExamples,
    rng: np.random.Generator,
    texels: tuple[int, int],
    steps: int,
    learning_rate: float,
) -> Float64:
    """A texture that comes near its aim: Adam from a random start; the best of those looked at on the way.

    Each step looks at one image, with one of its displaced views.
    """
    texture = torch.from_numpy(random_texture(rng, texels)).float().requires_grad_()
    optimiser = torch.optim.Adam([texture], lr=learning_rate)
    best, lowest = texture.detach().clone(), examples.mean(texture.detach().double().numpy())
    look_every = max(len(examples.examples), steps // 10, 1)
    for step in range(steps):
        example = examples.examples[step % len(examples.examples)]
        view = example.views[int(rng.integers(len(example.views)))]
        gain = float(np.exp(rng.normal(0, BRIGHTER)))
        contrast = float(np.exp(rng.normal(0, CONTRAST)))
        noise = torch.from_numpy(rng.normal(0, NOISE, (len(view.view.pixels), 3))).float()
        shown = ((texture - 0.5) * contrast + 0.5).clamp(0, 1)
        score = examples.missed(shown, example, view, gain, noise)
        loss = torch.log(score.clamp(min=1e-6)) + ROUGHNESS * _variation(texture, texels)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        with torch.no_grad():
            texture.clamp_(0, 1)
        if (step + 1) % look_every == 0 or step + 1 == steps:
            mean = examples.mean(texture.detach().double().numpy())
            if mean < lowest:
                best, lowest = texture.detach().clone(), mean
    found: Float64 = best.double().numpy()
    return found


def _variation(texture: Tensor, texels: tuple[int, int]) -> Tensor:
    image = texture.reshape(*texels, 3)
    return (image[1:] - image[:-1]).abs().mean() + (image[:, 1:] - image[:, :-1]).abs().mean()
