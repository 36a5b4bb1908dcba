"""What the tests of attacks on clouds draw from, and how far points moved."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.messages.cloud import xyz


def rng(seed=0):
    return np.random.default_rng(seed)


def moved_m(before, after):
    """How far each point (N,) of two clouds of one length is from where it was."""
    return np.linalg.norm(xyz(after).astype(np.float64) - xyz(before).astype(np.float64), axis=1)
