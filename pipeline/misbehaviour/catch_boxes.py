"""CaTCH's intersection check, as VeReMi NextGen has it: ellipses around claimed positions.

Reimplemented from `mdm_lib.py` of VeReMi NextGen at 1643972f, with what it does otherwise than one expects:
every vehicle is 5 m by 1.8 m, and an ellipse is turned by the compass heading as if that were counted from
the x-axis the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.misbehaviour.claim import Claim

LENGTH_M, WIDTH_M = 5.0, 1.8
MAX_INTERSECTION_S = 5.0
"""The largest `max_intersection_s` of its search space: older boxes count with no setting."""
_CORNERS = 64
_SURE = 1e-10


class OtherBoxes:
    """Pairs of a message and another station's newest box before it, (P,) each.

    rows: of the message. overlap: from 0 to about 1. arrived_s, sent_s: the age of the box by arrival and by
    generation.
    """

    def __init__(self, claims: Sequence[Claim]) -> None:
        pairs, reach = _near_pairs(claims)
        self.rows = pairs[:, 0]
        others = pairs[:, 1]
        arrival_ns = np.array([claim.arrival_ns for claim in claims], np.int64)
        sent_ns = np.array([claim.generation_ns for claim in claims], np.int64)
        self.arrived_s = (arrival_ns[self.rows] - arrival_ns[others]) / 1e9
        self.sent_s = (sent_ns[self.rows] - sent_ns[others]) / 1e9
        self.overlap = _overlap(claims, self.rows, others, reach)

    def factors(self, messages: int, max_s: float) -> Float64:
        """The smallest factor of each message (M,); 1 where no box is near."""
        found = np.ones(messages)
        fresh = self.arrived_s <= max_s
        share = 1.01 - self.overlap * (max_s - self.sent_s) / max_s
        np.minimum.at(found, self.rows[fresh], np.clip(share[fresh], 0.0, 1.0))
        return found


def _near_pairs(claims: Sequence[Claim]) -> tuple[npt.NDArray[np.int64], Float64]:
    """Rows (P, 2) of messages and of near boxes, and half the diagonal of each message's ellipse (M,)."""
    places = np.array([(claim.x_m, claim.y_m) for claim in claims]).reshape(-1, 2)
    spread_m = 2 * np.array([claim.position_m for claim in claims])
    reach_m = np.hypot(LENGTH_M + spread_m, WIDTH_M + spread_m) / 2
    slots: dict[int, int] = {}
    newest = np.full(len({claim.station_id for claim in claims}), -1, np.int64)
    arrival_ns = np.array([claim.arrival_ns for claim in claims], np.int64)
    pairs = [np.zeros((0, 2), np.int64)]
    for row, claim in enumerate(claims):
        if not np.isfinite(places[row]).all():
            continue
        slot = slots.setdefault(claim.station_id, len(slots))
        others = newest[: len(slots)]
        is_other = others >= 0
        is_other[slot] = False
        others = others[is_other]
        others = others[arrival_ns[row] - arrival_ns[others] <= MAX_INTERSECTION_S * 1e9]
        distance_m = np.hypot(*(places[others] - places[row]).T)
        others = others[distance_m <= reach_m[others] + reach_m[row]]
        pairs.append(np.stack([np.full(len(others), row), others], axis=1))
        newest[slot] = row
    return np.concatenate(pairs), reach_m


def _overlap(
    claims: Sequence[Claim], rows: npt.NDArray[np.int64], others: npt.NDArray[np.int64], reach_m: Float64
) -> Float64:
    """Intersection over union of both ellipses, less where the intersection is far from both centres."""
    places = np.array([(claim.x_m, claim.y_m) for claim in claims]).reshape(-1, 2)
    spread_m = 2 * np.array([claim.position_m for claim in claims])
    axes_m = np.stack([LENGTH_M + spread_m, WIDTH_M + spread_m], axis=-1)
    heading_deg = np.degrees(np.pi / 2 - np.array([claim.yaw_rad for claim in claims])) % 360
    ellipses = [
        _ellipses(places[which] - places[rows], axes_m[which], heading_deg[which]) for which in (rows, others)
    ]
    common = np.nan_to_num(shapely.area(shapely.intersection(*ellipses)))
    area = np.pi * axes_m[:, 0] * axes_m[:, 1] / 4
    union = area[rows] + area[others] - common
    with np.errstate(invalid="ignore", divide="ignore"):
        by_area = np.where(union > 0, common / union, 0.0)
        importance = _importance(
            places[others] - places[rows], axes_m[rows], axes_m[others], heading_deg, rows, others
        )
        # As Python's min and max treat what is no number: no overlap.
        found = np.where(by_area < importance * by_area, by_area, importance * by_area)
    return np.where(np.isnan(found), 0.0, found)


def _ellipses(centres_m: Float64, axes_m: Float64, heading_deg: Float64) -> npt.NDArray[np.object_]:
    """Polygons of 64 corners with their corners on the ellipses."""
    angle = np.arange(_CORNERS) * 2 * np.pi / _CORNERS
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    turned = np.radians(np.trunc(heading_deg / 0.01) * 0.01)
    cos, sin = np.cos(turned)[:, None], np.sin(turned)[:, None]
    x, y = (circle[None] * axes_m[:, None] / 2).transpose(2, 0, 1)
    corners = np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1) + centres_m[:, None]
    found: npt.NDArray[np.object_] = shapely.polygons(corners)
    return found


def _importance(
    between_m: Float64,
    axes_m: Float64,
    other_axes_m: Float64,
    heading_deg: Float64,
    rows: npt.NDArray[np.int64],
    others: npt.NDArray[np.int64],
) -> Float64:
    """How much of both claimed positions, as normal distributions, lies where the ellipses meet, over the
    distance."""
    distance = np.hypot(*between_m.T)
    distance = np.where(distance == 0, 1e-4, distance)
    towards = np.arctan2(between_m[:, 0], between_m[:, 1])
    radii = []
    for axes, which in ((axes_m, rows), (other_axes_m, others)):
        off = np.radians(np.trunc(heading_deg[which] / 0.01) * 0.01) - towards
        off = np.arctan2(np.sin(off), np.cos(off))
        off = np.where(off > np.pi / 2, off - np.pi, np.where(off < -np.pi / 2, off + np.pi, off))
        radii.append(axes[:, 0] / 2 * np.sin(off) + axes[:, 1] / 2 * np.cos(off))
    one, other = radii
    overlap = other + one - distance
    small, large = np.minimum(one, other), np.maximum(one, other)
    is_inside = overlap >= 2 * small
    by_small = np.where(is_inside, 1.0, _normal((-small + overlap) / (small / 3))) / np.where(
        is_inside, 1.0, overlap / (2 * small)
    )
    begin, end = -(distance + small), -(distance - small)
    across = _normal(end / (large / 3)) - _normal(begin / (large / 3))
    by_large = np.where(
        is_inside,
        across / (2 * small / (2 * large)),
        _normal((-large + overlap) / (large / 3)) / (overlap / (2 * large)),
    )
    found = 2 * by_small * by_large / (by_small + by_large) / distance
    return np.where((overlap < 0) | (distance < _SURE), 0.0, found)


def _normal(value: Float64) -> Float64:
    """The normal distribution, by the approximation 7.1.26 of Abramowitz and Stegun."""
    sign, x = np.where(value < 0, -1.0, 1.0), np.abs(value) / np.sqrt(2.0)
    t = 1 / (1 + 0.3275911 * x)
    series = 0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))
    found: Float64 = 0.5 * (1 + sign * (1 - series * t * np.exp(-x * x)))
    return found
