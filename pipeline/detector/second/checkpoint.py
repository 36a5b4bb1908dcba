"""Checkpoints of SECOND: one safetensors file with the weights, the preset's name and the provenance."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import torch
from pydantic import Field
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from advpipe.pipeline.bag.document import Document, Text, Word, read_json
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import preset_named
from advpipe.pipeline.errors import AdvpipeError, OutputExistsError

KIND = "advpipe-second-1"
SHIPPED = {"small": Path(__file__).parent / "checkpoints" / "small.safetensors"}
"""Checkpoints that come with the package."""


class _About(Document):
    """The metadata of a checkpoint, under the key `advpipe`."""

    kind: Literal["advpipe-second-1"]
    preset: Word
    classes: Annotated[tuple[Word, ...], Field(max_length=100)]
    provenance: dict[Word, Text]


def save_checkpoint(
    net: SecondNet, path: Path, provenance: Mapping[str, str], *, half: bool = True, overwrite: bool = False
) -> None:
    """Write the weights in half precision or single, the batch norms in single; beside, then renamed.

    provenance: how the weights were trained, kept as text.
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
        "preset": net.preset.name,
        "classes": list(net.preset.classes),
        "provenance": dict(sorted(provenance.items())),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.part")
    # A single metadata key: safetensors does not fix the order of several.
    beside.write_bytes(save(tensors, metadata={"advpipe": json.dumps(about)}))
    os.replace(beside, path)


def load_checkpoint(path: Path, device: torch.device | None = None) -> Second:
    """The detector in a checkpoint file, its weights in single precision, on the device (the CPU)."""
    if not path.is_file():
        raise AdvpipeError(f"no detector checkpoint at {path}; train one with `advpipe train`")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise AdvpipeError(
            f"{path} is not a whole safetensors file ({error}); train or copy it again"
        ) from None
    where = f"{path} is no detector checkpoint of advpipe"
    about: _About = read_json(metadata.get("advpipe", ""), _About, where, "make one with `advpipe train`")
    name = about.preset
    net = SecondNet(preset_named(name))
    if about.classes != net.preset.classes:
        raise AdvpipeError(
            f"{path} finds {list(about.classes)}, preset {name!r} finds {list(net.preset.classes)}; train "
            "again"
        )
    ours = {k: v.shape for k, v in net.state_dict().items() if v.is_floating_point()}
    if ours != {k: v.shape for k, v in tensors.items()}:
        raise AdvpipeError(f"the weights in {path} do not fit preset {name!r} of this version; train again")
    if not all(bool(torch.isfinite(weights).all()) for weights in tensors.values()):
        raise AdvpipeError(f"the weights in {path} are not all finite; train or copy it again")
    net.load_state_dict(tensors, strict=False)
    return Second(net.to(device), about.provenance)
