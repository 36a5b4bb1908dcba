"""Weights in a safetensors file: written in half precision, read back by untrusted files' rules."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import OutputExistsError, UsageError
from advpipe.pipeline.core.short_repr import shorten

MOST_BYTES = 1 << 28
"""The largest preset has 21 MB of weights in single precision."""

MOST_HEADER_BYTES = 1 << 20
"""Ours have 16 kB; safetensors' own limit is some hundred times larger."""

N = TypeVar("N", bound=torch.nn.Module)

ReadMetadata = Callable[[Path, Mapping[str, str]], tuple[N, dict[str, str]]]
"""The network that a file's metadata name, without its weights, and their provenance; raises UsageError."""


def write_weights(
    net: torch.nn.Module, path: Path, about: Mapping[str, Any], *, half: bool = True, overwrite: bool = False
) -> None:
    """Write the weights atomically, in half or single precision, batch norms in single. about: metadata."""
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
    tensors = {}
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            dtype = torch.float16 if half and value.ndim > 1 else torch.float32
            tensors[name] = value.detach().cpu().to(dtype).contiguous()
    path.parent.mkdir(parents=True, exist_ok=True)
    # A single metadata key: safetensors does not keep the order of several.
    write_atomically(path, save(tensors, metadata={"advpipe": json.dumps(about)}))


def read_weights(
    path: Path, read_metadata: ReadMetadata[N], preset: Callable[[N], str]
) -> tuple[N, dict[str, str]]:
    """The network of a file with its weights in single precision, and their provenance.

    preset: the name of a network's preset. Raises UsageError for a damaged file, and for weights that do not
    fit.
    """
    check_size(path)
    try:
        with safe_open(path, framework="pt") as file:
            net, provenance = read_metadata(path, file.metadata() or {})
            ours = {k: v.shape for k, v in net.state_dict().items() if v.is_floating_point()}
            # Compare the declared shapes before any tensor is read.
            shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118
            if {name: torch.Size(shape) for name, shape in shapes.items()} != ours:
                raise UsageError(
                    f"the weights in {path} do not fit preset {preset(net)!r} of this version; train again"
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
    return net, provenance


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
