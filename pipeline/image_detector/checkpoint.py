"""Checkpoints of image detectors: one safetensors file with weights, preset and provenance."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import torch
from pydantic import Field

from advpipe.pipeline.core.document import Document, ShortText, Text, read_json
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr, shorten
from advpipe.pipeline.detector.weights_file import read_weights, write_weights
from advpipe.pipeline.image_detector.network import PRESETS, ImageNet
from advpipe.pipeline.image_detector.network_detector import NetworkImageDetector

KIND = "advpipe-image-detector-1"


class _Metadata(Document):
    """The metadata of a checkpoint, under the key `advpipe`."""

    kind: Literal["advpipe-image-detector-1"]
    preset: ShortText
    classes: Annotated[tuple[ShortText, ...], Field(max_length=100)]
    provenance: dict[ShortText, Text]


def save_image_checkpoint(
    net: ImageNet, path: Path, provenance: Mapping[str, str], *, overwrite: bool = False
) -> None:
    """Write a checkpoint atomically: weights in half precision, batch norms in single."""
    about = {
        "kind": KIND,
        "preset": net.preset.name,
        "classes": list(net.preset.classes),
        "provenance": dict(sorted(provenance.items())),
    }
    write_weights(net, path, about, overwrite=overwrite)


def load_image_checkpoint(path: Path, device: torch.device | None = None) -> NetworkImageDetector:
    """The detector in a checkpoint file, with weights in single precision.

    Raises UsageError for a file that is not such a checkpoint, or whose preset is unknown.
    """
    if not path.is_file():
        raise UsageError(f"no image detector's checkpoint at {path}; train one with `advpipe train-camera`")
    net, provenance = read_weights(path, _read_metadata, lambda net: net.preset.name)
    return NetworkImageDetector(net.to(device), provenance)


def _read_metadata(path: Path, metadata: Mapping[str, str]) -> tuple[ImageNet, dict[str, str]]:
    where = f"{path} is not an image detector's checkpoint of advpipe"
    with as_usage_error():
        about: _Metadata = read_json(
            metadata.get("advpipe", ""), _Metadata, where, "make one with `advpipe train-camera`"
        )
    if about.preset not in PRESETS:
        raise UsageError(
            f"{path} has preset {short_repr(about.preset)}; {known_names(about.preset, PRESETS)}"
        )
    preset = PRESETS[about.preset]
    if about.classes != preset.classes:
        raise UsageError(
            f"{path} finds {shorten(str(list(about.classes)), 200)}, preset {about.preset!r} finds "
            f"{list(preset.classes)}; train again"
        )
    return ImageNet(preset), dict(about.provenance)
