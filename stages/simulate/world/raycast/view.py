"""What a camera sees of the world: the nearest surface of each ray, with its look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.surfaces import PaneViews, Surfaces
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.body_look import BodyLook, body_tags
from advpipe.stages.simulate.world.raycast.instanced_bodies import CandidateSights, InstancedBodies
from advpipe.stages.simulate.world.raycast.materials import (
    MATERIAL_ID,
    SEMANTIC,
    SEMANTIC_CLASSES,
    SPECULAR,
    TEXTURE,
)
from advpipe.stages.simulate.world.raycast.scene import Scene
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
_STATIC_TAGS[MATERIAL_ID["rail"]] = TAG["GuardRail"]
_IS_THIN = np.array([texture == "leaves" for texture in TEXTURE])
_IS_FINE = np.array([name in ("sign", "plate", "lamp") for name in MATERIAL_ID])
_LAST = np.uint8(255)
_IS_ROOM = np.array([name == "room" for name in MATERIAL_ID])
_WETS = np.array([SEMANTIC_CLASSES[each] in ("road", "marking", "pavement") for each in SEMANTIC])


class Viewer:
    """Looks at a static scene and the bodies in it."""

    def __init__(self, static: Scene, look: StaticLook, bodies: InstancedBodies, body_look: BodyLook) -> None:
        self._static, self._look = static, look
        self._bodies, self._body_look = bodies, body_look

    def surfaces(self, rays: Float32, users: Sequence[RoadUser], pixel_rad: float) -> Surfaces:
        """The first opaque surface of each ray (R, 6) from one origin; objects index `users`."""
        static = self._static.sight(rays)
        seen = self._bodies.candidate_sights(rays, users)
        alone = np.flatnonzero(seen.sight.triangles >= 0)
        first = _first(static, seen, alone)
        own = seen.rays[first]
        candidate_of = np.zeros(len(rays), np.int32)
        static.range_m[own], candidate_of[own] = seen.sight.range_m[first], first
        # In the order of materials, so that each is one slice; road users come last.
        keys = self._static.materials_of(static.triangles)
        keys[own] = _LAST
        met = np.flatnonzero(np.isfinite(static.range_m))
        met = met[np.argsort(keys[met], kind="stable")]
        materials = keys[met]
        fixed = int(np.searchsorted(materials, _LAST))
        range_m, triangles = static.range_m[met], static.triangles[met[:fixed]].astype(np.intp)
        directions = np.stack([np.take(rays[:, axis], met, mode="clip") for axis in (3, 4, 5)])
        points_m = directions * range_m + rays[:1, :3].T
        candidates = candidate_of[met[fixed:]]
        normals = np.empty_like(directions)
        self._static.normals_of(triangles, normals[:, :fixed])
        rotations = np.array([user.map_SE3_base[:3, :3] for user in users], np.float32).reshape(-1, 3, 3)
        user_of = seen.users[candidates]
        normals[:, fixed:] = _turned(rotations[user_of], seen.sight.normals[candidates])
        cos = normals[0] * directions[0] + normals[1] * directions[1] + normals[2] * directions[2]
        normals *= -np.copysign(np.float32(1), cos)
        colour, lamps = np.empty_like(directions), np.zeros(len(met), np.uint8)
        detail_m = range_m * np.float32(pixel_rad) / np.sqrt(np.maximum(np.abs(cos), np.float32(0.003)))
        self._look.paint(colour, materials[:fixed], triangles, points_m, normals, detail_m)
        objects = np.full(len(met), -1, np.int32)
        objects[fixed:] = user_of
        if len(user_of):
            materials[fixed:] = self._body_look.materials(seen.sight.triangles[candidates])
            local_m = _local_points(points_m[:, fixed:].T, users, user_of)
            of_bodies, lamps[fixed:] = self._body_look.colours(materials[fixed:], users, user_of, local_m)
            colour[:, fixed:] = of_bodies.T
        tags = _STATIC_TAGS[materials]
        tags[fixed:] = body_tags(materials[fixed:], users, user_of) if len(user_of) else 0
        panes = _panes(static, seen, rotations)
        is_inside = _IS_ROOM[materials] | (_marked(len(rays), panes.rays)[met] & (objects >= 0))
        return Surfaces(
            met,
            range_m,
            points_m,
            normals,
            colour,
            SPECULAR[materials],
            _IS_THIN[materials],
            _IS_FINE[materials],
            _WETS[materials],
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
        rays[:, :3], rays[:, 3:] = points_m.T, sun
        shaded = self._static.is_occluded(rays)
        lit = np.flatnonzero(~shaded)
        shaded[lit] = self._bodies.shades(np.take(points_m, lit, axis=1), sun, users)
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


def _local_points(points_m: Float32, users: Sequence[RoadUser], user_of: npt.NDArray[np.int64]) -> Float32:
    poses = np.array([user.map_SE3_base for user in users])
    away = points_m - poses[user_of, :3, 3].astype(np.float32)
    local: Float32 = np.einsum("nji,nj->ni", poses[:, :3, :3].astype(np.float32)[user_of], away)
    return local


def _marked(count: int, chosen: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """A mask (count,) of the chosen indices."""
    marked = np.zeros(count, np.bool_)
    marked[chosen] = True
    return marked


def _turned(rotations: Float32, vectors: Float32) -> Float32:
    """Vectors (N, 3), each turned by its rotation (N, 3, 3), as rows (3, N)."""
    turned: Float32 = np.einsum("nij,nj->in", rotations, vectors)
    return turned


def _panes(static: VisibleHits, seen: CandidateSights, rotations: Float32) -> PaneViews:
    """The panes before the surfaces that rays see; `static` has the range of the nearest one."""
    moving = seen.sight.panes
    rays = np.concatenate([static.panes.rays, seen.rays[moving.rays]])
    near = np.concatenate([static.panes.range_m, moving.range_m]) < static.range_m[rays]
    transmittance = np.concatenate([static.panes.transmittance, moving.transmittance])
    turned = _turned(rotations[seen.users[moving.rays]], moving.normals)
    normals = np.concatenate([static.panes.normals.T, turned], axis=1)[:, near]
    return PaneViews(rays[near], transmittance[near], normals)
