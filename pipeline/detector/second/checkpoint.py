"""Checkpoints of SECOND: one safetensors file with the weights, the preset's name and the provenance."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import preset_named
from advpipe.pipeline.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.shown import cut, shown

KIND = "advpipe-second-1"
SHIPPED = {"small": Path(__file__).parent / "checkpoints" / "small.safetensors"}
"""Checkpoints that come with the package."""

MOST_BYTES = 1 << 28
"""The largest preset has 21 MB of weights in single precision."""

MOST_HEADER_BYTES = 1 << 20
"""Ours have 16 kB; readers take some hundred times that."""


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
    _check_size(path)
    try:
        with safe_open(path, framework="pt") as file:
            net, provenance = _told_by(path, file.metadata() or {})
            ours = {k: v.shape for k, v in net.state_dict().items() if v.is_floating_point()}
            # By what the file declares, before any of it is unpacked.
            shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118
            if {name: torch.Size(shape) for name, shape in shapes.items()} != ours:
                preset = net.preset.name
                raise AdvpipeError(
                    f"the weights in {path} do not fit preset {preset!r} of this version; train again"
                )
            tensors = {name: file.get_tensor(name).float() for name in ours}
    except (SafetensorError, OSError, RuntimeError) as error:
        reason = cut(" ".join(str(error).split()), 200)
        raise AdvpipeError(
            f"{path} is not a whole safetensors file ({reason}); train or copy it again"
        ) from None
    if not all(bool(torch.isfinite(weights).all()) for weights in tensors.values()):
        raise AdvpipeError(f"the weights in {path} are not all finite; train or copy it again")
    net.load_state_dict(tensors, strict=False)
    return Second(net.to(device), provenance)


def _check_size(path: Path) -> None:
    """The header's length and the file's, before either is read."""
    size_bytes = path.stat().st_size
    with path.open("rb") as file:
        header_bytes = int.from_bytes(file.read(8), "little")
    if size_bytes > MOST_BYTES:
        raise AdvpipeError(f"{path} has {size_bytes} bytes; no checkpoint of advpipe has over {MOST_BYTES}")
    if header_bytes > MOST_HEADER_BYTES:
        reason = f"a header of {header_bytes} bytes"
        raise AdvpipeError(f"{path} is not a whole safetensors file ({reason}); train or copy it again")


def _told_by(path: Path, metadata: Mapping[str, str]) -> tuple[SecondNet, dict[str, str]]:
    """The network that a checkpoint is of, its weights not set, and how it was trained."""
    try:
        about = json.loads(metadata["advpipe"])
        if about["kind"] != KIND:
            raise KeyError
        name, classes, provenance = about["preset"], about["classes"], about["provenance"]
        if not (isinstance(name, str) and isinstance(classes, list) and isinstance(provenance, dict)):
            raise TypeError
        if not all(isinstance(text, str) for text in provenance.values()):
            raise TypeError
    except (KeyError, TypeError, ValueError, RecursionError):
        raise AdvpipeError(
            f"{path} is no detector checkpoint of advpipe; make one with `advpipe train`"
        ) from None
    net = SecondNet(preset_named(name))
    if classes != list(net.preset.classes):
        raise AdvpipeError(
            f"{path} finds {shown(classes)}, preset {name!r} finds {list(net.preset.classes)}; train again"
        )
    return net, provenance
