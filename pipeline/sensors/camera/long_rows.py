"""Products of small matrices with vectors that are stored component by component, in three long rows.

BLAS starts threads for such thin products; where other processes use all processors already, each thread
waits for the others, which takes ten times as long as the sums themselves.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


def along(direction: npt.ArrayLike, vectors: Float32) -> Float32:
    """The components (K,) of vectors (3, K) along a direction (3,)."""
    x, y, z = np.asarray(direction, np.float32)
    found: Float32 = vectors[0] * x
    found += vectors[1] * y
    found += vectors[2] * z
    return found


def turned(matrix: npt.ArrayLike, vectors: Float32) -> Float32:
    """The products (3, K) of a matrix (3, 3) with vectors (3, K)."""
    return np.stack([along(row, vectors) for row in np.asarray(matrix, np.float32)])


def chosen_columns(vectors: Float32, chosen: npt.NDArray[np.int64]) -> Float32:
    """The chosen (N,) of vectors (3, K), as (3, N); the indices are not checked."""
    found = np.empty((len(vectors), len(chosen)), vectors.dtype)
    for row, out in zip(vectors, found, strict=True):
        np.take(row, chosen, out=out, mode="clip")
    return found
