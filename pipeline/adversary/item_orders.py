"""In which order items are taken: points to remove, or places to add one."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

LEAST_SPREAD_M = 0.05
"""Directions are drawn in units of the items' spread, and of no less than this."""

BY_GRADIENT = "gradient"

ORDERS = tuple(itertools.product(("scattered", "side", "around", BY_GRADIENT), (False, True)))
"""Each order and whether items inside of boxes come first. Scattered; from a random side, so that the object
seems smaller or larger than it is; around a random item, so that whole voxels or pillars empty or fill; by
the gradient of the loss."""

NEEDS_GRADIENT = np.array([name == BY_GRADIENT for name, _ in ORDERS])


def ordered(
    items: Int64, order: int, xyz_m: Float64, gains: Float64, is_inside: Bool, rng: np.random.Generator
) -> Int64:
    """The items (K,) of one object in one of the `ORDERS`, with random parameters.

    xyz_m: (I, 3) where all items are. gains: (I,) by the gradient. is_inside: (I,) those in a box.
    """
    name, inside_first = ORDERS[order]
    if name == "scattered":
        found = rng.permutation(items)
    else:
        found = items[np.argsort(_keys(name, xyz_m[items], gains[items], rng), kind="stable")]
    return found[np.argsort(~is_inside[found], kind="stable")] if inside_first else found


def _keys(name: str, xyz_m: Float64, gains: Float64, rng: np.random.Generator) -> Float64:
    """By which places (K, 3) are taken, the lowest first."""
    if name == BY_GRADIENT or not len(xyz_m):
        return -gains
    if name == "side":
        direction = rng.standard_normal(3) / np.maximum(xyz_m.std(axis=0), LEAST_SPREAD_M)
        along: Float64 = xyz_m @ direction
        return along
    away_m: Float64 = np.linalg.norm(xyz_m - xyz_m[rng.integers(len(xyz_m))], axis=1)
    return away_m
