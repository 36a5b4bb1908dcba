"""Points that scatter the radar's wave, and what is known of each: place, velocity, RCS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.radar.aim import Aim
from advpipe.pipeline.sensors.radar.cross_section import clutter_rcs_m2, road_user_rcs_m2
from advpipe.pipeline.sensors.world import Hits

WHEEL_SHARE = 0.1
"""Share of a vehicle's RCS that its wheels return together."""

_HAS_FLOOR = np.array([name in ("car", "truck") for name in CLASSES])

LEAST_M = 0.2
"""Nearer things are in the radome or on the vehicle."""


@dataclass(frozen=True)
class Scatterers:
    """N scattering points in the radar's frame.

    position_m: (N, 3). velocity_mps: (N, 3), relative to the ground. rcs_m2: (N,), mean. height_m: (N,), over
    the road. users: (N,), index of a road user; -1 for clutter.
    """

    position_m: Float64
    velocity_mps: Float64
    rcs_m2: Float64
    height_m: Float64
    users: npt.NDArray[np.int64]

    def __add__(self, other: Scatterers) -> Scatterers:
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__dataclass_fields__)
        return Scatterers(*map(np.concatenate, pairs))

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> Scatterers:
        return Scatterers(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def scatterers_of(
    aim: Aim, hits: Hits, boxes: Boxes, turn_rate_radps: Float64, rng: np.random.Generator
) -> Scatterers:
    """What the rays of a scan hit: road users with their aimed rays, all else with the grid.

    boxes: in the radar's frame, with velocities. turn_rate_radps: (M,) of each about its vertical. A ray that
    hits another road user than that at which it is aimed counts for neither.
    """
    range_m = hits.range_m.astype(np.float64)
    far_enough = np.isfinite(range_m) & (range_m >= LEAST_M)
    on_user = np.flatnonzero(far_enough & (aim.users >= 0) & (hits.objects == aim.users))
    on_else = np.flatnonzero(far_enough & (aim.users < 0) & (hits.objects < 0))
    place_m = aim.directions[on_else] * range_m[on_else, None]
    surfaces = None if hits.surfaces is None else hits.surfaces[on_else]
    clutter = Scatterers(
        place_m,
        np.zeros_like(place_m),
        clutter_rcs_m2(surfaces, range_m[on_else], aim.ray_solid_angle_sr),
        place_m[:, 2],
        np.full(len(on_else), -1),
    )
    return _on_road_users(aim, hits, boxes, turn_rate_radps, on_user, rng) + clutter


def beneath_vehicles(
    aim: Aim, hits: Hits, boxes: Boxes, turn_rate_radps: Float64, share: float
) -> Scatterers:
    """Road users that vehicles hide, by way of the road beneath these: a share of the power of each ray."""
    is_vehicle = np.append(_HAS_FLOOR[boxes.labels], False)  # the last for what is no road user
    hidden = (aim.users >= 0) & ~aim.is_wheel & is_vehicle[hits.objects] & (hits.objects != aim.users)
    rays = np.flatnonzero(hidden & (share > 0))
    users, ahead = aim.users[rays], aim.directions[rays]
    place_m = ahead * _range_to_box_m(ahead, boxes.geometry[users])[:, None]
    rcs = road_user_rcs_m2(boxes.labels, aspects_rad(boxes)) * aim.shares
    aimed = np.bincount(aim.users[(aim.users >= 0) & ~aim.is_wheel], minlength=len(boxes))
    rcs_m2 = rcs[users] / np.maximum(aimed, 1)[users] * share
    return _moving(boxes, users, place_m, rcs_m2, turn_rate_radps)


def _range_to_box_m(ahead: Float64, geometry: Float64) -> Float64:
    """Range (N,) along directions (N, 3) from the radar to the faces of boxes (N, 7) in front of it."""
    cos, sin = np.cos(geometry[:, 6]), np.sin(geometry[:, 6])
    local = [
        np.stack([cos * one[:, 0] + sin * one[:, 1], cos * one[:, 1] - sin * one[:, 0], one[:, 2]], axis=1)
        for one in (-geometry[:, :3], ahead)
    ]
    slopes = np.where(np.abs(local[1]) < 1e-9, 1e-9, local[1])
    faces = [(side * geometry[:, 3:6] / 2 - local[0]) / slopes for side in (-1, 1)]
    return np.asarray(np.maximum(np.minimum(*faces).max(axis=1), LEAST_M))


def _on_road_users(
    aim: Aim,
    hits: Hits,
    boxes: Boxes,
    turn_rate_radps: Float64,
    rays: npt.NDArray[np.int64],
    rng: np.random.Generator,
) -> Scatterers:
    users, is_wheel = aim.users[rays], aim.is_wheel[rays]
    place_m = aim.directions[rays] * hits.range_m[rays, None].astype(np.float64)
    rcs = road_user_rcs_m2(boxes.labels, aspects_rad(boxes))
    rcs *= (1 - hits.occlusion.astype(np.float64)) * aim.shares
    count = np.bincount(users[~is_wheel], minlength=len(boxes))
    of_body = 1 - WHEEL_SHARE * bool(aim.is_wheel.any())
    rcs_m2 = np.where(
        is_wheel, rcs[users] * WHEEL_SHARE / 4, rcs[users] * of_body / np.maximum(count, 1)[users]
    )
    found = _moving(boxes, users, place_m, rcs_m2, turn_rate_radps)
    found.velocity_mps[is_wheel] += _rim_velocity_mps(boxes, users[is_wheel], rng)
    return found


def _moving(
    boxes: Boxes,
    users: npt.NDArray[np.int64],
    place_m: Float64,
    rcs_m2: Float64,
    turn_rate_radps: Float64,
) -> Scatterers:
    """Points (N, 3) on road users, with the velocity that each has as a part of its body."""
    centre = boxes.geometry[users]
    arm_m = place_m - centre[:, :3]
    turn = turn_rate_radps[users]
    velocity_mps = boxes.velocity_mps[users].copy()
    velocity_mps[:, 0] -= turn * arm_m[:, 1]
    velocity_mps[:, 1] += turn * arm_m[:, 0]
    height_m = place_m[:, 2] - (centre[:, 2] - centre[:, 5] / 2)
    return Scatterers(place_m, velocity_mps, rcs_m2, height_m, users)


def aspects_rad(boxes: Boxes) -> Float64:
    """The angle (M,) from the front of each box to the radar, at the origin."""
    x_m, y_m, yaw = boxes.geometry[:, 0], boxes.geometry[:, 1], boxes.geometry[:, 6]
    return np.asarray(np.arctan2(-y_m, -x_m) - yaw)


def _rim_velocity_mps(boxes: Boxes, users: npt.NDArray[np.int64], rng: np.random.Generator) -> Float64:
    """Velocity (N, 3) of a random point of a rolling wheel's rim relative to the vehicle: from 0 to twice the
    vehicle's speed over the ground."""
    speed = np.linalg.norm(boxes.velocity_mps[users], axis=1)
    yaw, place = boxes.geometry[users, 6], rng.uniform(0, 2 * np.pi, len(users))
    ahead = speed * np.cos(place)
    return np.stack([ahead * np.cos(yaw), ahead * np.sin(yaw), speed * np.sin(place)], axis=1)
