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
from advpipe.stages.simulate.world.raycast.sight import Glimpses, Sight
from advpipe.stages.simulate.world.raycast.static_look import StaticLook

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
_WETS = np.array([SEMANTIC_CLASSES[each] in ("road", "marking", "pavement") for each in SEMANTIC])


class Viewer:
    """Looks at a static scene and the bodies in it."""

    def __init__(self, static: Scene, look: StaticLook, bodies: InstancedBodies, body_look: BodyLook) -> None:
        self._static, self._look = static, look
        self._bodies, self._body_look = bodies, body_look

    def surfaces(self, rays: Float32, users: Sequence[RoadUser], pixel_rad: float) -> Surfaces:
        """The first opaque surface of each ray (R, 6); objects are indices into `users`."""
        static = self._static.sight(rays)
        seen = self._bodies.candidate_sights(rays, users)
        alone = np.flatnonzero(seen.sight.triangles >= 0)
        first = _first(static, seen, alone)
        range_m, normals = static.range_m, static.normals
        objects = np.full(len(rays), -1, np.int32)
        own = seen.rays[first]
        objects[own] = seen.users[first]
        range_m[own], normals[own] = seen.sight.range_m[first], seen.sight.normals[first]
        materials = np.zeros(len(rays), np.uint8)
        colour, lamps = np.zeros((len(rays), 3), np.float32), np.zeros(len(rays), np.uint8)
        fixed = np.flatnonzero((static.triangles >= 0) & (objects < 0))
        points_m = _points(rays, range_m, fixed)
        materials[fixed] = self._static.materials_of(static.triangles[fixed])
        detail_m = range_m[fixed] * np.float32(pixel_rad)
        grazing = np.abs(np.einsum("ij,ij->i", normals[fixed], rays[fixed, 3:]))
        detail_m /= np.maximum(np.sqrt(grazing), np.float32(0.05))
        colour[fixed] = self._look.colours(static.triangles[fixed], points_m, normals[fixed], detail_m)
        tags = _STATIC_TAGS[materials]
        if len(own):
            materials[own] = self._body_look.materials(seen.sight.triangles[first])
            user_of = seen.users[first]
            local_m = _local_points(_points(rays, range_m, own), users, user_of)
            colour[own], lamps[own] = self._body_look.colours(materials[own], users, user_of, local_m)
            tags[own] = body_tags(materials[own], users, user_of)
        tags[~np.isfinite(range_m)] = TAG["Sky"]
        return Surfaces(
            range_m,
            normals,
            colour,
            SPECULAR[materials],
            _IS_THIN[materials],
            _IS_FINE[materials],
            _WETS[materials],
            lamps,
            materials,
            tags,
            objects,
            _panes(range_m, static.panes, seen),
            seen.rays[alone],
            seen.users[alone],
        )

    def is_shaded(self, points_m: Float32, sun: Float32, users: Sequence[RoadUser]) -> npt.NDArray[np.bool_]:
        """Whether the scene or a road user is between points (N, 3) and the sun, in the direction (3,)."""
        rays = np.empty((len(points_m), 6), np.float32)
        rays[:, :3], rays[:, 3:] = points_m, sun
        shaded = self._static.is_occluded(rays)
        lit = np.flatnonzero(~shaded)
        shaded[lit] = self._bodies.shades(points_m[lit], sun, users)
        return shaded


def moved_on(users: Sequence[RoadUser], time_s: float) -> Sequence[RoadUser]:
    """The road users a moment later, at constant velocity."""
    return [replace(user, map_SE3_base=_moved(user.map_SE3_base, user.velocity_mps * time_s)) for user in users]


def _moved(map_SE3_base: Float64, offset_m: Float64) -> Float64:
    moved = map_SE3_base.copy()
    moved[:3, 3] += offset_m
    return moved


def _first(
    static: Sight, seen: CandidateSights, alone: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The candidates that are the nearest surface of their ray, one a ray."""
    nearest_m = static.range_m.copy()
    np.minimum.at(nearest_m, seen.rays[alone], seen.sight.range_m[alone])
    rays, range_m = seen.rays[alone], seen.sight.range_m[alone]
    first = alone[(range_m == nearest_m[rays]) & (range_m < static.range_m[rays])]
    _, once = np.unique(seen.rays[first], return_index=True)
    return first[once]


def _points(rays: Float32, range_m: Float32, chosen: npt.NDArray[np.int64]) -> Float32:
    points: Float32 = rays[chosen, :3] + range_m[chosen, None] * rays[chosen, 3:]
    return points


def _local_points(points_m: Float32, users: Sequence[RoadUser], user_of: npt.NDArray[np.int64]) -> Float32:
    poses = np.array([user.map_SE3_base for user in users])
    away = points_m - poses[user_of, :3, 3].astype(np.float32)
    local: Float32 = np.einsum("nji,nj->ni", poses[:, :3, :3].astype(np.float32)[user_of], away)
    return local


def _panes(range_m: Float32, static: Glimpses, seen: CandidateSights) -> PaneViews:
    """The panes before the surfaces that rays see."""
    moving = seen.sight.panes
    rays = np.concatenate([static.rays, seen.rays[moving.rays]])
    near = np.concatenate([static.range_m, moving.range_m]) < range_m[rays]
    transmittance = np.concatenate([static.transmittance, moving.transmittance])
    return PaneViews(rays[near], transmittance[near], np.concatenate([static.normals, moving.normals])[near])
