"""Checkpoints: one safetensors file with the weights, the names of family and preset, and the provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import torch
from pydantic import Field

from advpipe.pipeline.core.document import Document, ShortText, Text, read_json
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.detector.common.network import DetectionNetwork
from advpipe.pipeline.detector.families import family_named, shipped_checkpoints
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.training_maps import with_listed_maps
from advpipe.pipeline.detector.weights_file import read_weights, write_weights

KIND = "advpipe-detector-1"


class _Metadata(Document):
    """The metadata of a checkpoint, under the key `advpipe`.

    Kind `advpipe-second-1` dates from when SECOND was the only family, and names no family.
    """

    kind: Literal["advpipe-detector-1", "advpipe-second-1"]
    family: ShortText = "second"
    preset: ShortText
    classes: Annotated[tuple[ShortText, ...], Field(max_length=100)]
    provenance: dict[ShortText, Text]


@dataclass(frozen=True)
class Checkpoint:
    """A trained network, and the provenance of its weights, as text."""

    net: DetectionNetwork
    provenance: Mapping[str, str]

    def detector(self) -> ObjectDetector:
        """The network as a detector, its weights frozen."""
        return self.net.detector(self.provenance)


def save_checkpoint(
    net: DetectionNetwork,
    path: Path,
    provenance: Mapping[str, str],
    *,
    half: bool = True,
    overwrite: bool = False,
) -> None:
    """Write a checkpoint atomically: weights in half or single precision, batch norms in single.

    provenance: how the weights were trained, as text.
    """
    about = {
        "kind": KIND,
        "family": net.preset.family,
        "preset": net.preset.name,
        "classes": list(net.preset.classes),
        "provenance": dict(sorted(provenance.items())),
    }
    write_weights(net, path, about, half=half, overwrite=overwrite)


def load_checkpoint(path: Path, device: torch.device | None = None) -> Checkpoint:
    """Load a checkpoint file, with weights in single precision, to a device (default: the CPU).

    Raises UsageError for a file that is not a checkpoint, or whose family or preset is unknown.
    """
    if not path.is_file():
        raise UsageError(f"no detector checkpoint at {path}; train one with `advpipe train`")
    net, provenance = read_weights(path, _read_metadata, lambda net: net.preset.name)
    return Checkpoint(net.to(device), with_listed_maps(provenance, path, shipped_checkpoints().values()))


def _read_metadata(path: Path, metadata: Mapping[str, str]) -> tuple[DetectionNetwork, dict[str, str]]:
    """The network of a checkpoint, without its weights, and how it was trained."""
    where = f"{path} is not a detector checkpoint of advpipe"
    with as_usage_error():
        about: _Metadata = read_json(
            metadata.get("advpipe", ""), _Metadata, where, "make one with `advpipe train`"
        )
    family = family_named(about.family)
    preset = family.preset(about.preset)
    if about.classes != preset.classes:
        raise UsageError(
            f"{path} finds {shorten(str(list(about.classes)), 200)}, preset {about.preset!r} finds "
            f"{list(preset.classes)}; train again"
        )
    return family.network(about.preset), dict(about.provenance)
