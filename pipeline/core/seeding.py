"""Random generators: one seed in the scenario, and one named generator for each use of randomness."""

from __future__ import annotations

import zlib

import numpy as np


def named_generator(seed: int, *names: str | int) -> np.random.Generator:
    """A random generator, independent of the generators with other names under the same seed.

    Adding a consumer with a new name does not change the draws of any other.

        >>> rng = named_generator(7, "lidar", "ego", frame_index)
    """
    keys = [name if isinstance(name, int) else zlib.crc32(name.encode()) for name in names]
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=tuple(keys)))
