"""Checkpoints of image detectors: one safetensors file with weights, preset and provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import torch
from pydantic import Field
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.document import Document, ShortText, Text, read_json
from advpipe.pipeline.core.errors import OutputExistsError, UsageError, as_usage_error
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr, shorten
from advpipe.pipeline.detector.checkpoint import check_size
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
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
    tensors = {}
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            dtype = torch.float16 if value.ndim > 1 else torch.float32
            tensors[name] = value.detach().cpu().to(dtype).contiguous()
    about = {
        "kind": KIND,
        "preset": net.preset.name,
        "classes": list(net.preset.classes),
        "provenance": dict(sorted(provenance.items())),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, save(tensors, metadata={"advpipe": json.dumps(about)}))


def load_image_checkpoint(path: Path, device: torch.device | None = None) -> NetworkImageDetector:
    """The detector in a checkpoint file, with weights in single precision.

    Raises UsageError for a file that is not such a checkpoint, or whose preset is unknown.
    """
    if not path.is_file():
        raise UsageError(f"no image detector's checkpoint at {path}; train one with `advpipe train-camera`")
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
