"""Shares of circles and intervals, as CaTCH's checks in VeReMi NextGen take them.

A value within a claimed confidence is a circle or an interval around it; a check asks which share of it is
plausible. Reimplemented from `mdm_lib.py` of VeReMi NextGen at 1643972f, array by array; all arguments have
the same shape, radii are in metres and not negative.
"""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64


def lens_area(one_m: Float64, other_m: Float64, distance_m: Float64) -> Float64:
    """The area that two circles of these radii have in common; 0 where a radius is 0."""
    small, large = np.minimum(one_m, other_m), np.maximum(one_m, other_m)
    d = distance_m
    to_one = (one_m**2 + d**2 - other_m**2) / (2 * one_m * d)
    to_other = (other_m**2 + d**2 - one_m**2) / (2 * other_m * d)
    phi, theta = 2 * _arccos(to_one), 2 * _arccos(to_other)
    lens = (theta - np.sin(theta)) * other_m**2 / 2 + (phi - np.sin(phi)) * one_m**2 / 2
    area = np.where(d <= large - small, np.pi * small**2, lens)
    return np.where((small <= 0) | (d > one_m + other_m), 0.0, area)


def segment_area(radius_m: Float64, height_m: Float64) -> Float64:
    """The area of a circle up to a height above its lowest point."""
    r, h = radius_m, np.clip(height_m, 0.0, 2 * radius_m)
    return r**2 * _arccos((r - h) / r) - (r - h) * np.sqrt(np.maximum(2 * r * h - h**2, 0.0))


def share_within(distance_m: Float64, one_m: Float64, other_m: Float64, range_m: Float64) -> Float64:
    """The share of two circles around places a distance apart that is within half of a range of a point
    between the two."""
    from_one, from_other = _places(distance_m, one_m, other_m, range_m)
    half = range_m / 2
    area_one, area_other = lens_area(one_m, half, from_one), lens_area(other_m, half, from_other)
    both = (area_one + area_other) / (np.pi * (one_m**2 + other_m**2))
    one = np.where(half >= from_other, area_one / (np.pi * one_m**2), 0.0)
    other = np.where(half >= from_one, area_other / (np.pi * other_m**2), 0.0)
    return _by_radii(both, one, other, (range_m >= distance_m).astype(np.float64), one_m, other_m)


def share_below(distance_m: Float64, one_m: Float64, other_m: Float64, most_m: Float64) -> Float64:
    """The share of two circles whose distance is at most so long, by segments."""
    from_one, from_other = _places(distance_m, one_m, other_m, most_m)
    half = most_m / 2
    area_one = segment_area(one_m, half - from_one + one_m)
    area_other = segment_area(other_m, half - from_other + other_m)
    both = (area_one + area_other) / (np.pi * (one_m**2 + other_m**2))
    one = np.where(half >= from_other, area_one / (np.pi * one_m**2), 0.0)
    other = np.where(half >= from_one, area_other / (np.pi * other_m**2), 0.0)
    share = _by_radii(both, one, other, (most_m >= distance_m).astype(np.float64), one_m, other_m)
    share = np.where(most_m < distance_m - one_m - other_m, 0.0, share)
    return np.where(most_m > distance_m + one_m + other_m, 1.0, share)


def share_above(distance_m: Float64, one_m: Float64, other_m: Float64, least_m: Float64) -> Float64:
    """The share of distances between two circles that is at least so long, lower where the distance itself
    is shorter."""
    spread = one_m + other_m
    share = (distance_m + spread - least_m) / (2 * spread)
    # Where only one place is uncertain, its interval counts as it is; with two, it is weighted.
    weight = np.clip(0.5 + (distance_m - least_m) / spread, 0.0, 1.0)
    share = np.where((one_m > 0) & (other_m > 0), np.where(distance_m > 0, share * weight, share), share)
    share = np.where(distance_m + spread <= least_m, 0.0, share)
    return np.where(distance_m - spread >= least_m, 1.0, share)


def share_of_intervals(distance: Float64, one: Float64, other: Float64, range_: Float64) -> Float64:
    """`share_within` for intervals of these half-widths."""
    from_one, from_other = _places(distance, one, other, range_)
    half = range_ / 2
    inside = [
        np.where(place - half < width, np.where(place - half > -width, half - place + width, 2 * width), 0.0)
        for place, width in ((from_one, one), (from_other, other))
    ]
    share = (inside[0] + inside[1]) / (2 * one + 2 * other)
    return np.where((one == 0) & (other == 0), np.where(distance > range_, 0.0, 1.0), share)


def _places(
    distance_m: Float64, one_m: Float64, other_m: Float64, range_m: Float64
) -> tuple[Float64, Float64]:
    """The distances of both places from the point between them from which the range is taken."""
    d, half = distance_m, range_m / 2
    from_one = (one_m**2 + d**2 - other_m**2) / (2 * d)
    from_other = (other_m**2 + d**2 - one_m**2) / (2 * d)
    near_one = (from_one + one_m < half) & (from_other + other_m > half)
    shift = np.where(near_one, half - from_one - one_m, 0.0)
    from_one, from_other = from_one + shift, from_other - shift
    near_other = (from_other + other_m < half) & (from_one + one_m > half)
    shift = np.where(near_other, half - from_other - other_m, 0.0)
    is_apart = d > 0
    return np.where(is_apart, from_one - shift, 0.0), np.where(is_apart, from_other + shift, 0.0)


def _by_radii(
    both: Float64, one: Float64, other: Float64, none: Float64, one_m: Float64, other_m: Float64
) -> Float64:
    """The share by which radii are larger than 0."""
    by_one = np.where(other_m > 0, both, one)
    return np.where(one_m > 0, by_one, np.where(other_m > 0, other, none))


def _arccos(value: Float64) -> Float64:
    return np.arccos(np.clip(value, -1.0, 1.0))
