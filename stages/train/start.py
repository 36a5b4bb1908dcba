"""Weights that a training run starts from."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.detector.checkpoint import load_checkpoint
from advpipe.pipeline.detector.common.network import DetectionNetwork


def start_from(net: DetectionNetwork, checkpoint: Path) -> None:
    """Take the weights of a checkpoint: all of them, or, of another family, those that both networks have.

    A CenterPoint has the layers of a SECOND up to its head. Raises UsageError for another preset of the same
    family, and for a family that shares less than half of its weights.
    """
    start = load_checkpoint(checkpoint).net
    if start.preset == net.preset:
        net.load_state_dict(start.state_dict())
        return
    own = net.state_dict()
    shared = {
        name: weights
        for name, weights in start.state_dict().items()
        if name in own and weights.shape == own[name].shape and weights.ndim > 0
    }
    count = sum(weights.numel() for weights in shared.values())
    if start.preset.family == net.preset.family or 2 * count < sum(
        weights.numel() for weights in own.values()
    ):
        raise UsageError(
            f"{checkpoint} holds {_named(start)}, which has too few of the layers of {_named(net)} to start "
            f"from; give a checkpoint of {_named(net)}, or leave out --start"
        )
    net.load_state_dict(own | shared)
    notice(f"{_named(net)} starts from {counted(count, 'weight')} of {checkpoint}; its other layers are new")


def _named(net: DetectionNetwork) -> str:
    family = "" if net.preset.family == "second" else f" of family {net.preset.family!r}"
    return f"preset {net.preset.name!r}{family}"
