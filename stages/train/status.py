"""What the progress bar says about a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from advpipe.stages.train.validate import ClassPrecision

SMOOTHING = 0.98
"""Of the loss shown: it remembers about 50 steps."""


@dataclass
class Status:
    """The smoothed loss and the last average precision."""

    loss: float = 0.0
    steps: int = 0
    precision: dict[str, ClassPrecision] = field(default_factory=dict)

    def step(self, losses: Sequence[float]) -> None:
        """Note the parts of a step's loss."""
        self.loss = SMOOTHING * self.loss + (1 - SMOOTHING) * sum(losses)
        self.steps += 1

    def text(self) -> str:
        """Such as `loss 0.82, AP car 71 truck 40`."""
        loss = self.loss / (1 - SMOOTHING**self.steps) if self.steps else float("nan")
        found = [f"{name} {p.strict_percent:.0f}" for name, p in self.precision.items() if p.boxes]
        return f"loss {loss:.2f}" + (f", AP {' '.join(found)}" if found else "")
