"""Weights of networks that OpenPCDet trained, for the presets that equal its configurations."""

from __future__ import annotations

import pickle
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.short_repr import shorten
from advpipe.pipeline.detector.common.backbone3d import STRIDED
from advpipe.pipeline.detector.common.openpcdet_configurations import (
    Configuration,
    configuration_of,
    refusal,
)
from advpipe.pipeline.detector.common.preset import AnchorPreset, SparsePreset
from advpipe.pipeline.detector.common.torch_archive import check_archive
from advpipe.pipeline.detector.common.voxel_network import VoxelNetwork

LAYERS_3D = {
    "stage1.0": "conv_input",
    "stage1.1": "conv1.0",
    **{f"stage{stage}.{layer}": f"conv{stage}.{layer}" for stage in (2, 3, 4) for layer in range(3)},
    "fold": "conv_out",
}
"""OpenPCDet's names of advpipe's sparse layers; in them, `.0` is the convolution and `.1` its batch norm."""

MOST_VALUES = 20_000_000
"""Limit on all weights: four times the true number, so that weights of a wrong shape can be reported."""

HEADS = ("conv_cls", "conv_box", "conv_dir_cls")
COUNTERS = re.compile(r"(^|\.)(global_step|num_batches_tracked)$")


def import_openpcdet(path: Path, net: VoxelNetwork[Any, Any]) -> dict[str, str]:
    """Give a network, of its family's preset for OpenPCDet's weights, those of a checkpoint; their origin.

    Code in the file is never run. Its sparse weights may have the layout of spconv 1 or spconv 2.
    Raises AdvpipeError for every other file, with the reason.
    """
    wanted = configuration_of(net.preset.family)
    ours = {name: value for name, value in net.state_dict().items() if value.is_floating_point()}
    theirs = _read_weights(path, {their for name in ours for their in their_names(name)}, wanted)
    converted = {}
    for name, value in ours.items():
        parts = {their: theirs[their] for their in their_names(name)}
        if name.startswith("backbone3d") and value.ndim == 3:
            converted[name] = _sparse_weight(path, parts, value, wanted)
        else:
            converted[name] = _joined(path, parts, value, net, wanted)
    if isinstance(net.preset, SparsePreset):
        # The bird's-eye map stacks the z layers of a column: in OpenPCDet by channel, in advpipe by layer.
        first, channels = "backbone2d.blocks.0.0.weight", net.preset.channels_3d[-1]
        rows, columns, *kernel = converted[first].shape
        layers = columns // channels
        stacked = converted[first].reshape(rows, channels, layers, *kernel).transpose(1, 2)
        converted[first] = stacked.reshape(rows, columns, *kernel)
    net.load_state_dict(converted, strict=False)
    return {"source": f"an OpenPCDet checkpoint of {wanted.file}", "source_sha256": sha256_of(path)}


def their_names(name: str) -> tuple[str, ...]:
    """OpenPCDet's names of one of advpipe's weights; the anchor head's convolution joins three of
    OpenPCDet's."""
    part, _, rest = name.partition(".")
    layer, _, leaf = rest.rpartition(".")
    if part == "encoder":
        return (f"vfe.pfn_layers.0.{rest}",)
    if part == "head":
        return _names_in_head(layer, leaf)
    if part == "backbone3d":
        place = int(layer.endswith(".norm"))
        return (f"backbone_3d.{LAYERS_3D[layer.removesuffix('.norm')]}.{place}.{leaf}",)
    list_name, block, place_2d = layer.split(".")
    if list_name == "ups":
        return (f"backbone_2d.deblocks.{block}.{place_2d}.{leaf}",)
    # Their blocks begin with a layer for the padding.
    return (f"backbone_2d.blocks.{block}.{int(place_2d) + 1}.{leaf}",)


def _names_in_head(layer: str, leaf: str) -> tuple[str, ...]:
    kind, _, place = layer.partition(".")
    if kind == "convolution":
        return tuple(f"dense_head.{head}.{leaf}" for head in HEADS)
    if kind == "shared":
        return (f"dense_head.shared_conv.{place}.{leaf}",)
    branch, _, number = place.partition(".")
    inner = f"0.{number}" if kind == "hidden" else "1"
    return (f"dense_head.heads_list.0.{branch}.{inner}.{leaf}",)


def _read_weights(path: Path, names: set[str], wanted: Configuration) -> dict[str, Tensor]:
    """The tensors of `model_state`; raises an error unless they are those named and training-step
    counters."""
    checkpoint = _load(path)
    state = checkpoint.get("model_state") if isinstance(checkpoint, dict) else None
    if not isinstance(state, dict) or not all(isinstance(value, Tensor) for value in state.values()):
        raise UsageError(f"{path} holds no `model_state` of tensors; it is not an OpenPCDet checkpoint")
    given = {str(name) for name in state if not COUNTERS.search(str(name))}
    if other := refusal({str(name): tuple(value.shape) for name, value in state.items()}, wanted):
        raise UsageError(f"{path} {other}")
    found = {"lacks": names - given, "has": given - names}
    wrong = [f"{verb} {_some(some)}" for verb, some in found.items() if some]
    if wrong:
        raise UsageError(
            f"{path} is no {wanted.network} of OpenPCDet's {wanted.file}: it {' and '.join(wrong)}"
        )
    # An expanded tensor of any shape is stored as a single number: check the shape before reading it.
    if sum(state[name].numel() for name in names) > MOST_VALUES:
        raise UsageError(
            f"{path} is no {wanted.network} of OpenPCDet's {wanted.file}: its weights are too large"
        )
    for name in sorted(names):
        value = state[name]
        is_plain = value.layout is torch.strided and value.device.type == "cpu" and value.is_floating_point()
        if not is_plain or not torch.isfinite(value.float()).all():
            raise AdvpipeError(f"{path}: {name} holds values that are not finite")
    return {name: state[name].float() for name in names}


def _some(names: Iterable[str], shown: int = 3) -> str:
    """The first names and how many more there are."""
    ordered = sorted(names)
    more = f" and {len(ordered) - shown} more" if len(ordered) > shown else ""
    return ", ".join(map(shorten, ordered[:shown])) + more


def _load(path: Path) -> object:
    if not path.is_file():
        raise UsageError(f"no OpenPCDet checkpoint at {path}")
    check_archive(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError:
        raise UsageError(f"{path} was not written by torch.save") from None
    except Exception as error:  # torch.load may raise anything for other bytes
        raise AdvpipeError(
            f"{path} is truncated or not written by torch.save ({type(error).__name__}); copy it again"
        ) from None


def _sparse_weight(path: Path, parts: dict[str, Tensor], ours: Tensor, wanted: Configuration) -> Tensor:
    """A sparse weight (K, C_in, C_out) of spconv 2, (C_out, z, y, x, C_in), or 1, (z, y, x, C_in, C_out)."""
    ((name, weight),) = parts.items()
    offsets, c_in, c_out = ours.shape
    kernel = STRIDED[-1][0] if offsets == 3 else (3, 3, 3)
    if weight.shape == (c_out, *kernel, c_in):
        return weight.permute(1, 2, 3, 4, 0).reshape(ours.shape)
    if weight.shape == (*kernel, c_in, c_out):
        return weight.reshape(ours.shape)
    raise _wrong_shape(path, name, weight, (c_out, *kernel, c_in), wanted)


def _joined(
    path: Path, parts: dict[str, Tensor], ours: Tensor, net: VoxelNetwork[Any, Any], wanted: Configuration
) -> Tensor:
    """A dense weight, or the anchor head's three concatenated."""
    rows, preset = [len(ours)], net.preset
    if len(parts) > 1 and isinstance(preset, AnchorPreset):
        anchors = len(preset.anchors) * len(preset.yaws_rad)
        rows = [anchors * len(preset.classes), anchors * 7, anchors * 2]
    for (name, weight), count in zip(parts.items(), rows, strict=True):
        if weight.shape != (count, *ours.shape[1:]):
            raise _wrong_shape(path, name, weight, (count, *ours.shape[1:]), wanted)
    return torch.cat(list(parts.values()))


def _wrong_shape(
    path: Path, name: str, weight: Tensor, shape: tuple[int, ...], wanted: Configuration
) -> AdvpipeError:
    return AdvpipeError(
        f"{path} is no {wanted.network} of OpenPCDet's {wanted.file}: "
        f"{name} has shape {tuple(weight.shape)}, not {tuple(shape)}"
    )
