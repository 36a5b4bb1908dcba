"""The text of a run's progress bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from advpipe.stages.train.validate import ClassPrecision

SMOOTHING = 0.98
"""Exponential smoothing of the losses shown, over about 50 steps."""


@dataclass
class Status:
    """The smoothed losses of a network's `LOSS_PARTS`, and the last average precision."""

    parts: tuple[str, ...]
    losses: list[float] = field(default_factory=list)
    steps: int = 0
    precision: dict[str, ClassPrecision] = field(default_factory=dict)

    def step(self, losses: Sequence[float]) -> None:
        """Add the parts of a step's loss."""
        pairs = zip(self.losses or [0.0] * len(losses), losses, strict=True)
        self.losses = [SMOOTHING * old + (1 - SMOOTHING) * new for old, new in pairs]
        self.steps += 1

    def text(self) -> str:
        """The text, such as `loss 0.82 (score 0.5 box 0.2 direction 0.1), AP car 71 truck 40`."""
        if not self.steps:
            return "no step yet"
        losses = [loss / (1 - SMOOTHING**self.steps) for loss in self.losses]
        parts = [
            f"{name.removesuffix('_loss')} {loss:.2g}"
            for name, loss in zip(self.parts, losses, strict=True)
            if loss
        ]
        found = [f"{name} {p.strict_percent:.0f}" for name, p in self.precision.items() if p.boxes]
        return f"loss {sum(losses):.2f} ({' '.join(parts)})" + (f", AP {' '.join(found)}" if found else "")
