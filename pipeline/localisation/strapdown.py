"""Inertial navigation over one step, vectorised over its samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.motion import GRAVITY_MPS2
from advpipe.pipeline.localisation.rotations import rotation, skew


@dataclass(frozen=True)
class Increment:
    """The change over one step of inertial navigation, and its derivatives with respect to errors.

    rotation: (3, 3) at the end. velocity_mps, position_m: (3,), what to add to those at the start; to the
    position comes also the start's velocity times the duration.
    felt_velocity_mps, felt_position_m: (3,), the parts of these that the specific force brings.
    turned_s, pushed_s: (3, 3), sums of the rotations, over time and over time twice: what a rate in
    base_link turns the end, and what an acceleration in base_link displaces it.
    velocity_per_rate, position_per_rate: (3, 3), from an error of the rates in base_link.
    """

    duration_s: float
    rotation: Float64
    velocity_mps: Float64
    position_m: Float64
    felt_velocity_mps: Float64
    felt_position_m: Float64
    turned_s: Float64
    pushed_s2: Float64
    velocity_per_rate: Float64
    position_per_rate: Float64


def integrate(
    start: Float64, durations_s: Float64, specific_force_mps2: Float64, angular_rate_radps: Float64
) -> Increment:
    """Integrate n samples from an initial orientation (3, 3).

    durations_s: (n,). specific_force_mps2, angular_rate_radps: (n, 3) in base_link, free of their biases.
    In each sample the rate is constant; the force counts at its middle and the velocity grows evenly. The
    derivatives are those of preintegration (Forster et al. 2017, "On-manifold preintegration", appendix
    B), for errors of the orientation in the map's frame (Solà 2017, section 7).
    """
    halves = rotation(angular_rate_radps * (durations_s / 2)[:, None])
    middles = np.empty_like(halves)
    end = start
    for sample, half in enumerate(halves):
        middles[sample] = middle = end @ half
        end = middle @ half
    duration_s = float(durations_s.sum())
    felt = np.einsum("nij,nj->ni", middles, specific_force_mps2)
    # An acceleration in a sample displaces the end for the rest of the step, and half of its own time.
    lever_s2 = durations_s * (duration_s - np.cumsum(durations_s) + durations_s / 2)
    turning = middles * durations_s[:, None, None]
    turned_before = np.cumsum(turning, axis=0) - turning / 2
    tilting = -skew(felt) @ turned_before
    felt_velocity, felt_position = durations_s @ felt, lever_s2 @ felt
    return Increment(
        duration_s,
        end,
        felt_velocity + GRAVITY_MPS2 * duration_s,
        felt_position + GRAVITY_MPS2 * float(lever_s2.sum()),
        felt_velocity,
        felt_position,
        turning.sum(axis=0),
        np.tensordot(lever_s2, middles, 1),
        np.tensordot(durations_s, tilting, 1),
        np.tensordot(lever_s2, tilting, 1),
    )
