"""The checks: each computes one number from received messages; a larger number is less plausible.

NaN where a check does not apply: a value is not claimed, or there is nothing to compare with.
"""

from __future__ import annotations

import math

import numpy as np

from advpipe.pipeline.geometry.iou import intersection_area
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import Expectation

MIN_DISPLACEMENT_M = 1.0
"""Displacement from which the direction of motion is meaningful."""
MIN_SPEED_MPS = 1.0
_SHORT_S = 0.02


def claimed_range_m(claim: Claim, receiver: ReceivingVehicle) -> float:
    """The distance between the claimed position and the receiver."""
    return math.hypot(claim.x_m - receiver.x_m, claim.y_m - receiver.y_m)


def freshness_s(claim: Claim) -> float:
    """The age of a message on arrival; for one from the future, how far ahead it is."""
    return abs(claim.arrival_ns - claim.generation_ns) / 1e9


def frequency_hz(claim: Claim, last: Claim) -> float:
    """The inverse of the time since the station's last message, by arrival or generation, whichever is
    shorter.

    Infinite for a message that was generated no later than the last one.
    """
    arrived_s = (claim.arrival_ns - last.arrival_ns) / 1e9
    generated_s = (claim.generation_ns - last.generation_ns) / 1e9
    interval_s = min(arrived_s, generated_s)
    return 1 / interval_s if interval_s > 0 else math.inf


def elapsed_s(claim: Claim, last: Claim) -> float:
    """The time between the generation of two messages."""
    return (claim.generation_ns - last.generation_ns) / 1e9


def velocity_mps(claim: Claim) -> tuple[float, float]:
    """The claimed velocity along x and y."""
    return claim.speed_mps * math.cos(claim.yaw_rad), claim.speed_mps * math.sin(claim.yaw_rad)


def claimed_displacement_m(claim: Claim, last: Claim) -> tuple[float, float]:
    """The displacement between two messages that follows from the mean of their claimed velocities."""
    (x0, y0), (x1, y1) = velocity_mps(last), velocity_mps(claim)
    half_s = elapsed_s(claim, last) / 2
    return (x0 + x1) * half_s, (y0 + y1) * half_s


def unmodelled_m(claim: Claim, last: Claim, expected: Expectation) -> float:
    """What `claimed_displacement_m` does not model: changes of acceleration, the arc of a turn, and the
    swing of the box."""
    t = elapsed_s(claim, last)
    way_m = (abs(claim.speed_mps) + abs(last.speed_mps)) / 2 * abs(t)
    arc_m = expected.turn_share * _turned_rad(claim, last) * way_m
    return math.hypot(expected.acceleration_change_mps2 * t * t / 8, arc_m, swing_m(claim, last, expected))


def swing_m(claim: Claim, last: Claim, expected: Expectation) -> float:
    """How far the centre of the box may have moved across its heading in a turn; 0 without a length."""
    found_m = expected.swing_share * _turned_rad(claim, last) * claim.length_m / 2
    return found_m if found_m > 0 else 0.0


def _turned_rad(claim: Claim, last: Claim) -> float:
    """The angle turned between two messages, by their headings or their yaw rates; 1 at most."""
    turned_rad = abs(math.remainder(claim.yaw_rad - last.yaw_rad, math.tau))
    rates_radps = abs(claim.yaw_rate_radps), abs(last.yaw_rate_radps)
    by_rates_rad = max(rates_radps) * abs(elapsed_s(claim, last))
    return min(by_rates_rad if by_rates_rad > turned_rad else turned_rad, 1.0)


def displacement_sigma_m(elapsed: float, expected: Expectation, *bends_m: float) -> float:
    """The expected deviation of the claimed displacement from that between the claimed positions."""
    t = abs(elapsed)
    wander_m = expected.position_m_per_root_s * math.sqrt(t)
    return math.hypot(expected.position_m, wander_m, expected.speed_bias_mps * t, *bends_m)


def position_speed_sigma(claim: Claim, last: Claim, expected: Expectation) -> float:
    """The displacement since the last position against the one from both claimed speeds and headings."""
    x_m, y_m = claimed_displacement_m(claim, last)
    miss_m = math.hypot(claim.x_m - last.x_m - x_m, claim.y_m - last.y_m - y_m)
    return miss_m / displacement_sigma_m(
        elapsed_s(claim, last), expected, unmodelled_m(claim, last, expected)
    )


def heading_sigma(claim: Claim, last: Claim, expected: Expectation) -> float:
    """The direction of the displacement since the last position against the mean of both claimed headings.

    The centre of a turning vehicle moves outwards of its heading, more so the tighter the turn.
    """
    x_m, y_m = claim.x_m - last.x_m, claim.y_m - last.y_m
    way_m = math.hypot(x_m, y_m)
    speed = min(abs(claim.speed_mps), abs(last.speed_mps))
    if not (way_m >= MIN_DISPLACEMENT_M and speed >= MIN_SPEED_MPS):
        return math.nan
    turned_rad = math.remainder(claim.yaw_rad - last.yaw_rad, math.tau)
    moved_rad = math.atan2(y_m, x_m) + (math.pi if claim.speed_mps < 0 else 0.0)
    off_rad = abs(math.remainder(moved_rad - last.yaw_rad - turned_rad / 2, math.tau))
    t = abs(elapsed_s(claim, last))
    place_m = math.sqrt(expected.position_m**2 + expected.position_m_per_root_s**2 * t)
    outward_rad = expected.overhang_m * max(abs(claim.yaw_rate_radps), abs(last.yaw_rate_radps)) / speed
    if math.isnan(outward_rad):
        outward_rad = 0.0
    return off_rad / math.hypot(
        expected.heading_rad, place_m / way_m, outward_rad / 2, min(abs(turned_rad), 1.0) / 4
    )


def turn_sigma(claim: Claim, last: Claim, expected: Expectation) -> float:
    """The change of heading that the claimed yaw rates do not explain, over the expected deviation."""
    t = elapsed_s(claim, last)
    if t < _SHORT_S:
        return math.nan
    turned_rad = math.remainder(claim.yaw_rad - last.yaw_rad, math.tau)
    miss_rad = _outside(turned_rad, last.yaw_rate_radps * t, claim.yaw_rate_radps * t)
    steady_rad = math.hypot(expected.heading_rad, expected.heading_rad_per_root_s * math.sqrt(t))
    return miss_rad / math.hypot(steady_rad, expected.yaw_rate_change_radps * t)


def acceleration_sigma(claim: Claim, last: Claim, expected: Expectation) -> float:
    """The change of speed that the claimed accelerations do not explain, over the expected deviation."""
    t = elapsed_s(claim, last)
    if t < _SHORT_S:
        return math.nan
    changed_mps = claim.speed_mps - last.speed_mps
    miss_mps = _outside(changed_mps, last.acceleration_mps2 * t, claim.acceleration_mps2 * t)
    steady_mps = math.hypot(expected.speed_mps, expected.speed_mps_per_root_s * math.sqrt(t))
    # The driver's acceleration in between rarely goes far beyond the two claimed ones, less so in steady
    # traffic than where one brakes hard.
    change_mps2 = math.hypot(
        expected.acceleration_change_mps2 / 2,
        expected.acceleration_share * max(abs(claim.acceleration_mps2), abs(last.acceleration_mps2)),
    )
    return miss_mps / math.hypot(steady_mps, change_mps2 * t * min(t, 1.0))


def dynamics_mps2(claim: Claim, last: Claim | None) -> float:
    """The larger of the claimed acceleration and the one that follows from the speeds."""
    claimed = abs(claim.acceleration_mps2)
    if last is None:
        return claimed
    t = elapsed_s(claim, last)
    from_speeds = abs(claim.speed_mps - last.speed_mps) / max(t, 0.1) if t > 0 else math.nan
    return float(np.fmax(claimed, from_speeds))


def size_m(claim: Claim, last: Claim) -> float:
    """The larger change of the claimed length or width."""
    return float(np.fmax(abs(claim.length_m - last.length_m), abs(claim.width_m - last.width_m)))


def appearance_m(claim: Claim, receiver: ReceivingVehicle, earshot_m: float) -> float:
    """How far within reception range an unknown station claims to be."""
    return max(earshot_m - claimed_range_m(claim, receiver), 0.0)


def claimed_box(claim: Claim, at_ns: int) -> tuple[float, ...] | None:
    """The claimed box at another time, seen from above: columns of `BOX_COLUMNS`; None where none is
    claimed."""
    dx_mps, dy_mps = velocity_mps(claim)
    later_s = (at_ns - claim.generation_ns) / 1e9
    found = (
        *(claim.x_m + dx_mps * later_s, claim.y_m + dy_mps * later_s, 0.0),
        *(claim.length_m, claim.width_m, 1.0, claim.yaw_rad),
    )
    return found if all(map(math.isfinite, found)) else None


def overlap_share(own: tuple[float, ...], others: list[tuple[float, ...]], apart_m: float = 0.0) -> float:
    """The largest overlap with any other box, as a share of the smaller of the two boxes.

    apart_m: how much farther apart two boxes may be than their claimed centres.
    """
    near = [
        _moved_apart(own, other, apart_m)
        for other in others
        if math.hypot(other[0] - own[0], other[1] - own[1])
        <= (math.hypot(own[3], own[4]) + math.hypot(other[3], other[4])) / 2
    ]
    if not near:
        return 0.0
    boxes = np.array(near)
    common = intersection_area(np.repeat([own], len(near), axis=0), boxes)
    return float((common / np.minimum(own[3] * own[4], boxes[:, 3] * boxes[:, 4])).max())


def _moved_apart(own: tuple[float, ...], other: tuple[float, ...], apart_m: float) -> tuple[float, ...]:
    """The other box farther from this one; to its left if both have the same centre."""
    x_m, y_m = other[0] - own[0], other[1] - own[1]
    distance_m = math.hypot(x_m, y_m)
    if distance_m < 1e-6:
        x_m, y_m, distance_m = -math.sin(own[6]), math.cos(own[6]), 1.0
    share = apart_m / distance_m
    return (other[0] + share * x_m, other[1] + share * y_m, *other[2:])


def _outside(value: float, one: float, other: float) -> float:
    """The distance of a value from the interval between two others."""
    low, high = min(one, other), max(one, other)
    return max(low - value, value - high, 0.0) if math.isfinite(value + one + other) else math.nan
