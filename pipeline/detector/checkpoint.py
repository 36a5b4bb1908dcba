"""Checkpoints: one safetensors file with the weights, the names of family and preset, and the provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import torch
from pydantic import Field
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.document import Document, ShortText, Text, read_json
from advpipe.pipeline.core.errors import OutputExistsError, UsageError, as_usage_error
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.detector.common.network import DetectionNetwork
from advpipe.pipeline.detector.families import family_named, shipped_checkpoints
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.training_maps import with_listed_maps

KIND = "advpipe-detector-1"

MOST_BYTES = 1 << 28
"""The largest preset has 21 MB of weights in single precision."""

MOST_HEADER_BYTES = 1 << 20
"""Ours have 16 kB; safetensors' own limit is some hundred times larger."""


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
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
    tensors = {}
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            dtype = torch.float16 if half and value.ndim > 1 else torch.float32
            tensors[name] = value.detach().cpu().to(dtype).contiguous()
    about = {
        "kind": KIND,
        "family": net.preset.family,
        "preset": net.preset.name,
        "classes": list(net.preset.classes),
        "provenance": dict(sorted(provenance.items())),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    # A single metadata key: safetensors does not keep the order of several.
    write_atomically(path, save(tensors, metadata={"advpipe": json.dumps(about)}))


def load_checkpoint(path: Path, device: torch.device | None = None) -> Checkpoint:
    """Load a checkpoint file, with weights in single precision, to a device (default: the CPU).

    Raises UsageError for a file that is not a checkpoint, or whose family or preset is unknown.
    """
    if not path.is_file():
        raise UsageError(f"no detector checkpoint at {path}; train one with `advpipe train`")
    check_size(path)
    try:
        with safe_open(path, framework="pt") as file:
            net, provenance = _read_metadata(path, file.metadata() or {})
            ours = {k: v.shape for k, v in net.state_dict().items() if v.is_floating_point()}
            # Compare the declared shapes before any tensor is read.
            shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118
            if {name: torch.Size(shape) for name, shape in shapes.items()} != ours:
                preset = net.preset.name
                raise UsageError(
                    f"the weights in {path} do not fit preset {preset!r} of this version; train again"
                )
            tensors = {name: file.get_tensor(name).float() for name in ours}
    except (SafetensorError, OSError, RuntimeError) as error:
        reason = shorten(" ".join(str(error).split()), 200)
        raise UsageError(
            f"{path} is not a complete safetensors file ({reason}); train or copy it again"
        ) from None
    if not all(bool(torch.isfinite(weights).all()) for weights in tensors.values()):
        raise UsageError(f"the weights in {path} are not all finite; train or copy it again")
    net.load_state_dict(tensors, strict=False)
    return Checkpoint(net.to(device), with_listed_maps(provenance, path, shipped_checkpoints().values()))


def check_size(path: Path) -> None:
    """Check the lengths of header and file before either is read."""
    size_bytes = path.stat().st_size
    with path.open("rb") as file:
        header_bytes = int.from_bytes(file.read(8), "little")
    if size_bytes > MOST_BYTES:
        raise UsageError(f"{path} has {size_bytes} bytes; advpipe's checkpoints have at most {MOST_BYTES}")
    if header_bytes > MOST_HEADER_BYTES:
        reason = f"a header of {header_bytes} bytes"
        raise UsageError(f"{path} is not a complete safetensors file ({reason}); train or copy it again")


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
