"""Vehicles that stand between two antennas: loss by diffraction over their roofs.

As in Boban et al. (IEEE JSAC 29(1), 2011), each vehicle is a knife edge; several between the same antennas
become Bullington's equivalent edge, as in ITU-R P.526-15, 4.5.1. Diffraction around the sides is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64

Bool = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]

CLEARANCE = -0.78
"""The diffraction parameter below which an edge has no effect."""


@dataclass(frozen=True)
class Bodies:
    """The bodies of S vehicles, boxes on the ground.

    centre_m: (S, 2). forward: (S, 2), unit vectors. half_m: (S, 2), half of length and width. top_m: (S,),
    height of the roof on the map.
    """

    centre_m: Float64
    forward: Float64
    half_m: Float64
    top_m: Float64


def knife_edge_db(parameter: Float64) -> Float64:
    """Loss (...) by a single knife edge with diffraction parameter v (...) (ITU-R P.526-15, equation 31)."""
    beyond = np.maximum(parameter, CLEARANCE) - 0.1
    loss_db = 6.9 + 20 * np.log10(np.sqrt(np.square(beyond) + 1) + beyond)
    return np.where(parameter > CLEARANCE, np.maximum(loss_db, 0.0), 0.0)


def vehicle_loss_db(
    antenna_m: Float64, bodies: Bodies, senders: Int64, wanted: Bool, wavelength_m: float
) -> Float64:
    """Loss (T, S) from the antennas of `senders` (T,) to those of all stations (S, 3).

    wanted: (T, S), the pairs to compute; the others are zero. A vehicle's own body is no obstacle to it.
    """
    loss_db = np.zeros(wanted.shape)
    for row, sender in enumerate(senders.tolist()):
        receivers = np.flatnonzero(wanted[row])
        receivers = receivers[receivers != sender]
        if len(receivers):
            loss_db[row, receivers] = _from_sender(antenna_m, bodies, sender, receivers, wavelength_m)
    return loss_db


def _from_sender(
    antenna_m: Float64, bodies: Bodies, sender: int, receivers: Int64, wavelength_m: float
) -> Float64:
    """Loss (R,) from one antenna to those of the receivers (R,)."""
    origin_m, ends_m = antenna_m[sender], antenna_m[receivers]
    rays_m = ends_m[:, :2] - origin_m[:2]
    lengths_m = np.maximum(np.linalg.norm(rays_m, axis=1), 1e-9)
    nth, body = _near(origin_m[:2], rays_m / lengths_m[:, None], lengths_m, bodies)
    others = (body != sender) & (body != receivers[nth])
    nth, body = nth[others], body[others]
    place, is_crossed = _crossing(origin_m[:2], rays_m[nth], bodies, body)
    nth, body, place = nth[is_crossed], body[is_crossed], place[is_crossed]
    return _diffraction_db(
        len(receivers), nth, place * lengths_m[nth], bodies.top_m[body],
        lengths_m, origin_m[2], ends_m[:, 2], wavelength_m,
    )  # fmt: skip


def _near(origin_m: Float64, directions: Float64, lengths_m: Float64, bodies: Bodies) -> tuple[Int64, Int64]:
    """Rays and bodies whose circumscribed circle the ray meets."""
    delta_m = bodies.centre_m - origin_m
    radius_m = np.linalg.norm(bodies.half_m, axis=1)
    along_m = directions @ delta_m.T
    aside_m = np.abs(directions[:, :1] * delta_m[:, 1] - directions[:, 1:] * delta_m[:, 0])
    meets = (aside_m <= radius_m) & (along_m > -radius_m) & (along_m < lengths_m[:, None] + radius_m)
    ray, body = np.nonzero(meets)
    return ray, body


def _crossing(origin_m: Float64, rays_m: Float64, bodies: Bodies, body: Int64) -> tuple[Float64, Bool]:
    """The middle of each ray's way through a body as a share of the ray, and whether it meets the body."""
    forward, half_m = bodies.forward[body], bodies.half_m[body]
    left = np.column_stack([-forward[:, 1], forward[:, 0]])
    start_m = origin_m - bodies.centre_m[body]
    enters, leaves = np.zeros(len(body)), np.ones(len(body))
    for axis, half in ((forward, half_m[:, 0]), (left, half_m[:, 1])):
        begin = np.einsum("kx,kx->k", start_m, axis)
        speed = np.einsum("kx,kx->k", rays_m, axis)
        speed = np.where(np.abs(speed) < 1e-12, 1e-12, speed)
        one, other = (-half - begin) / speed, (half - begin) / speed
        enters, leaves = (
            np.maximum(enters, np.minimum(one, other)),
            np.minimum(leaves, np.maximum(one, other)),
        )
    return (enters + leaves) / 2, enters < leaves


def _diffraction_db(
    rays: int,
    nth: Int64,
    place_m: Float64,
    top_m: Float64,
    lengths_m: Float64,
    from_m: float,
    to_m: Float64,
    wavelength_m: float,
) -> Float64:
    """Loss (R,) by Bullington's equivalent edge of the obstacles (K,) of each ray."""
    before_m = np.clip(place_m, 1e-3, lengths_m[nth] - 1e-3)
    after_m = lengths_m[nth] - before_m
    rise, fall = np.full(rays, -np.inf), np.full(rays, -np.inf)
    np.maximum.at(rise, nth, (top_m - from_m) / before_m)
    np.maximum.at(fall, nth, (top_m - to_m[nth]) / after_m)
    direct_m = (from_m * after_m + to_m[nth] * before_m) / lengths_m[nth]
    parameter = np.full(rays, -np.inf)
    scale = np.sqrt(2 * lengths_m[nth] / (wavelength_m * before_m * after_m))
    np.maximum.at(parameter, nth, (top_m - direct_m) * scale)
    hidden = np.isfinite(rise) & (rise > (to_m - from_m) / lengths_m)
    length_m, up, down = lengths_m[hidden], rise[hidden], fall[hidden]
    edge_m = (to_m[hidden] - from_m + down * length_m) / (up + down)
    edge_m = np.clip(edge_m, 1e-3, length_m - 1e-3)
    rest_m = length_m - edge_m
    above_m = from_m + up * edge_m - (from_m * rest_m + to_m[hidden] * edge_m) / length_m
    parameter[hidden] = above_m * np.sqrt(2 * length_m / (wavelength_m * edge_m * rest_m))
    return knife_edge_db(parameter)
