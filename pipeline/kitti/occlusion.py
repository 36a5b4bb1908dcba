"""KITTI's levels of occlusion from the share of an object that is hidden."""

from __future__ import annotations

PARTLY_OCCLUDED, LARGELY_OCCLUDED = 0.15, 0.5
"""Occluded share from which an object is partly and largely occluded; KITTI's annotators judged by eye."""


def occlusion_level(occluded_share: float) -> int:
    """0: visible, 1: partly occluded, 2: largely occluded."""
    return int(occluded_share >= PARTLY_OCCLUDED) + int(occluded_share >= LARGELY_OCCLUDED)
