"""Random generators: one seed in the scenario, one named generator for each use of chance."""

from __future__ import annotations

import zlib

import numpy as np


def named_generator(seed: int, *names: str | int) -> np.random.Generator:
    """A generator for one use, independent of every other name under the same seed.

    A new consumer with a name of its own leaves the draws of all others as they were.

        >>> rng = named_generator(7, "lidar", "ego", frame_index)
    """
    keys = [name if isinstance(name, int) else zlib.crc32(name.encode()) for name in names]
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=tuple(keys)))
