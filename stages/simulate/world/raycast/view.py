"""What a camera sees of the world: the nearest surface of each ray, with its look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.long_rows import chosen_columns
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.surfaces import PaneViews, Surfaces
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.body_look import BodyLook, body_tags
from advpipe.stages.simulate.world.raycast.instanced_bodies import CandidateSights, InstancedBodies
from advpipe.stages.simulate.world.raycast.materials import (
    BY_TEXTURE,
    MATERIAL_ID,
    SEMANTIC,
    SEMANTIC_CLASSES,
    SPECULAR,
    TEXTURE,
)
from advpipe.stages.simulate.world.raycast.placed_users import PlacedUsers
from advpipe.stages.simulate.world.raycast.scene import Scene, of_triangles
from advpipe.stages.simulate.world.raycast.static_look import StaticLook
from advpipe.stages.simulate.world.raycast.visible_hits import VisibleHits

Float32 = npt.NDArray[np.float32]

_TAG_OF_CLASS = {
    "road": "Roads",
    "marking": "RoadLine",
    "pavement": "SideWalks",
    "ground": "Terrain",
    "vegetation": "Vegetation",
    "building": "Building",
    "pole": "Pole",
    "sign": "TrafficSign",
    "barrier": "Wall",
    "vehicle": "Static",
    "person": "Static",
    "other": "Static",
}
"""CARLA's tags of what stands beside the road."""

_STATIC_TAGS = np.array([TAG[_TAG_OF_CLASS[SEMANTIC_CLASSES[each]]] for each in SEMANTIC], np.uint8)
_TAG_OF_MATERIAL = {
    "rail": "GuardRail",
    "fence": "Fence",
    "fence_metal": "Fence",
    "signal_head": "TrafficLight",
    "planks": "Building",
    "skip": "Static",
}
for _name, _tag in _TAG_OF_MATERIAL.items():
    _STATIC_TAGS[MATERIAL_ID[_name]] = TAG[_tag]
_IS_THIN = np.array([texture == "leaves" for texture in TEXTURE])
_IS_FINE = np.array([name in ("sign", "plate", "lamp") for name in MATERIAL_ID])
_BODY, _SKY = 254, 255
_IS_ROOM = np.array([name == "room" for name in MATERIAL_ID])
_WETS = np.array([SEMANTIC_CLASSES[each] in ("road", "marking", "pavement") for each in SEMANTIC])


class Viewer:
    """Looks at a static scene and the bodies in it."""

    def __init__(self, static: Scene, look: StaticLook, bodies: InstancedBodies, body_look: BodyLook) -> None:
        self._static, self._look = static, look
        self._places = np.argsort(BY_TEXTURE).astype(np.uint8)[static.materials]
        self._bodies, self._body_look = bodies, body_look

    def placed(self, users: Sequence[RoadUser]) -> PlacedUsers:
        """See `InstancedBodies.placed`."""
        return self._bodies.placed(users)

    def surfaces(self, rays: Float32, users: Sequence[RoadUser], pixel_rad: float) -> Surfaces:
        """The first opaque surface of each ray (R, 6) from one origin; objects index `users`."""
        static, placed = self._static.sight(rays), self._bodies.placed(users)
        origin_m, all_directions = rays[:1, :3].T, np.ascontiguousarray(rays[:, 3:].T)
        seen = self._bodies.candidate_sights(origin_m, all_directions, placed)
        alone = np.flatnonzero(seen.sight.triangles >= 0)
        first = _first(static, seen, alone)
        own = seen.rays[first]
        candidate_of = np.zeros(len(rays), np.int32)
        static.range_m[own], candidate_of[own] = seen.sight.range_m[first], first
        # By texture and material, so that each is one slice; road users come last, before the sky.
        keys = of_triangles(self._places, static.triangles)
        keys[np.isinf(static.range_m)] = _SKY
        keys[own] = _BODY
        order = np.argsort(keys, kind="stable")
        counts = np.bincount(keys, minlength=_SKY + 1)
        fixed, count = int(counts[:_BODY].sum()), len(rays) - int(counts[_SKY])
        met, filled = order[:count], np.flatnonzero(counts[:_BODY])
        present, amounts = BY_TEXTURE[filled], counts[filled]
        range_m, triangles = np.take(static.range_m, met), np.take(static.triangles, met[:fixed])
        directions = chosen_columns(all_directions, met)
        points_m = directions * range_m + origin_m
        candidates = np.take(candidate_of, met[fixed:])
        normals = np.empty_like(directions)
        self._static.normals_of(triangles, normals[:, :fixed])
        user_of = np.take(seen.users, candidates)
        own_normals = np.ascontiguousarray(np.take(seen.sight.normals, candidates, axis=0).T)
        normals[:, fixed:] = placed.turned(user_of, own_normals)
        cos = normals[0] * directions[0] + normals[1] * directions[1] + normals[2] * directions[2]
        normals *= -np.copysign(np.float32(1), cos)
        colour, lamps = np.empty_like(directions), np.zeros(count, np.uint8)
        detail_m = range_m * np.float32(pixel_rad) / np.sqrt(np.maximum(np.abs(cos), np.float32(0.003)))
        self._look.paint(colour, present, amounts, triangles, points_m, normals, detail_m)
        materials = np.empty(count, np.uint8)
        materials[:fixed] = np.repeat(present, amounts)
        materials[fixed:] = self._body_look.materials(np.take(seen.sight.triangles, candidates))
        tags, objects = np.empty(count, np.uint8), np.full(count, -1, np.int32)
        tags[:fixed] = np.repeat(_STATIC_TAGS[present], amounts)
        if len(user_of):
            objects[fixed:] = user_of
            local_m = placed.local_points(user_of, points_m[:, fixed:])
            of_bodies, lamps[fixed:] = self._body_look.colours(
                materials[fixed:], placed.traits, user_of, local_m
            )
            colour[:, fixed:] = of_bodies.T
            tags[fixed:] = body_tags(materials[fixed:], placed.traits, user_of)
        panes = _panes(static, seen, placed)

        def by_material(table: npt.NDArray[Any]) -> npt.NDArray[Any]:
            """The values (K,) of a table by material: in runs, but for road users."""
            values = np.empty(count, table.dtype)
            values[:fixed] = np.repeat(table[present], amounts)
            np.take(table, materials[fixed:], out=values[fixed:], mode="clip")
            return values

        is_inside = by_material(_IS_ROOM)
        is_inside[fixed:] |= _marked(len(rays), panes.rays)[met[fixed:]]
        return Surfaces(
            all_directions,
            met,
            order[count:],
            range_m,
            points_m,
            normals,
            colour,
            by_material(SPECULAR),
            by_material(_IS_THIN),
            by_material(_IS_FINE),
            by_material(_WETS),
            is_inside,
            lamps,
            materials,
            tags,
            objects,
            panes,
            seen.rays[alone],
            seen.users[alone],
        )

    def is_shaded(self, points_m: Float32, sun: Float32, users: Sequence[RoadUser]) -> npt.NDArray[np.bool_]:
        """Whether the scene or a road user is between points (3, N) and the sun, in the direction (3,)."""
        rays = np.empty((points_m.shape[1], 6), np.float32)
        for axis in range(3):
            rays[:, axis], rays[:, 3 + axis] = points_m[axis], sun[axis]
        shaded = self._static.is_occluded(rays)
        lit = np.flatnonzero(~shaded)
        shaded[lit] = self._bodies.shades(chosen_columns(points_m, lit), sun, users)
        return shaded


def moved_on(users: Sequence[RoadUser], time_s: float) -> Sequence[RoadUser]:
    """The road users a moment later, at constant velocity."""
    return [
        replace(user, map_SE3_base=_moved(user.map_SE3_base, user.velocity_mps * time_s)) for user in users
    ]


def _moved(map_SE3_base: Float64, offset_m: Float64) -> Float64:
    moved = map_SE3_base.copy()
    moved[:3, 3] += offset_m
    return moved


def _first(static: VisibleHits, seen: CandidateSights, alone: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The candidates that are the nearest surface of their ray, one a ray."""
    rays, range_m = seen.rays[alone], seen.sight.range_m[alone]
    nearer = range_m < static.range_m[rays]
    rays, range_m, chosen = rays[nearer], range_m[nearer], alone[nearer]
    nearest_m = np.full(len(static.range_m), np.inf, np.float32)
    np.minimum.at(nearest_m, rays, range_m)
    first = range_m == nearest_m[rays]
    last = np.full(len(static.range_m), -1, np.int64)
    last[rays[first]] = chosen[first]  # one of those at the same range
    return last[last >= 0]


def _marked(count: int, chosen: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """A mask (count,) of the chosen indices."""
    marked = np.zeros(count, np.bool_)
    marked[chosen] = True
    return marked


def _panes(static: VisibleHits, seen: CandidateSights, placed: PlacedUsers) -> PaneViews:
    """The panes before the surfaces that rays see; `static` has the range of the nearest one."""
    moving, fixed = seen.sight.panes, static.panes
    rays, range_m = np.take(seen.rays, moving.rays), moving.range_m
    near = np.flatnonzero(range_m < np.take(static.range_m, rays))
    before = np.flatnonzero(fixed.range_m < np.take(static.range_m, fixed.rays))
    user_of = np.take(seen.users, np.take(moving.rays, near))
    turned = placed.turned(user_of, np.ascontiguousarray(np.take(moving.normals, near, axis=0).T))
    return PaneViews(
        np.concatenate([fixed.rays[before], rays[near]]),
        np.concatenate([fixed.transmittance[before], moving.transmittance[near]]),
        np.concatenate([fixed.normals[before].T, turned], axis=1),
    )
