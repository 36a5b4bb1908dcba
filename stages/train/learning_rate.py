"""The learning rate over a run."""

from __future__ import annotations

from math import cos, pi


def learning_rate(step: int, steps: int, peak: float, warmup: float) -> float:
    """Linear warm-up from a tenth over this share of the steps, then half a cosine down to a thousandth."""
    warm = warmup * steps
    if step < warm:
        return peak * (0.1 + 0.9 * step / warm)
    done = (step - warm) / max(1.0, steps - warm)
    return peak * (0.001 + 0.999 * (1 + cos(pi * done)) / 2)
