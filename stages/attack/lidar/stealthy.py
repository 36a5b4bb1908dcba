"""What the recipe `stealthy` adds: rays that returned nothing get the new points, and no part of a cloud
loses more returns than usual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.missing_returns import MissingReturnLimit
from advpipe.pipeline.adversary.places import Places, no_places, places_at
from advpipe.pipeline.attack_detection.occlusion_order import SURFACE_M, farthest_neighbour
from advpipe.pipeline.attack_detection.range_image import RangeImage
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import Cloud, cloud_of_xyzi, xyz
from advpipe.stages.attack.lidar.attach_problem import AttachProblem
from advpipe.stages.attack.lidar.detach_problem import DetachProblem

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

NO_RINGS = "recipe stealthy needs the rings of points, and the cloud states none"

NEIGHBOUR_COLUMNS = 3.0
"""The angle, in columns, between an empty ray and the clean point that a place on it starts from."""

STEP_M = 0.05
"""Between the places on one ray."""

ATTEMPTS = 5
"""How often other groups of points are proposed in place of those that would be noticed."""


def empty_ray_places(
    scene: Cloud,
    boxes: Float64,
    sensor: SensorGeometry,
    rules: Rules,
    eps_m: float,
    margin_m: float,
    rng: np.random.Generator,
) -> Places:
    """Places in or near boxes (M, 7), on rays that returned nothing: not one is behind a surface, and none is
    farther than `eps_m` from the clean point (N,) whose ray is the nearest."""
    image = RangeImage.of(scene, sensor)
    points = xyz(scene).astype(np.float64)
    near = np.unique(
        np.concatenate([np.zeros(0, np.int64), *points_in_boxes(points, boxes, margin_m + eps_m)])
    )
    row, column = np.nonzero(image.count == 0)
    ring = np.argsort(sensor.elevations_rad)[row]
    known = np.isfinite(sensor.elevations_rad[ring])
    ray = sensor.directions(ring[known], column[known])
    if not len(near) or not len(ray):
        return no_places()
    range_m = np.linalg.norm(points[near], axis=1)
    reach_rad = NEIGHBOUR_COLUMNS * 2 * np.pi / sensor.columns
    found, nearest = cKDTree(points[near] / range_m[:, None]).query(ray, distance_upper_bound=reach_rad)
    beside = np.flatnonzero(np.isfinite(found))
    steps_m = np.arange(-eps_m, eps_m, STEP_M)
    along_m = (
        range_m[nearest[beside]][:, None] + steps_m + rng.uniform(0, STEP_M, (len(beside), len(steps_m)))
    )
    source = np.repeat(near[nearest[beside]], len(steps_m))
    offset_m = (ray[beside][:, None] * along_m[..., None]).reshape(-1, 3) - points[source]
    clean = np.column_stack([xyz(scene), scene["intensity"]])
    places = places_at(clean, source, offset_m, boxes, margin_m, eps_m, rules)
    behind_m = farthest_neighbour(image.range_m) + SURFACE_M
    cloud = cloud_of_xyzi(places.points)
    in_front = np.linalg.norm(xyz(cloud), axis=1) < behind_m.flat[RangeImage.of(cloud, sensor).ray]
    return places[np.flatnonzero(in_front & ~rules.hidden(places.points[:, :3]))]


def rays_of(places: Places, sensor: SensorGeometry) -> Int64:
    """The number of the ray (C,) of each place."""
    cloud = cloud_of_xyzi(places.points)
    ring, column = sensor.cells(cloud)
    return ring * sensor.columns + column


@dataclass(eq=False, kw_only=True)
class StealthyAttachProblem(AttachProblem):
    """It proposes at most one place on each ray. rays: (C,) the ray of each place."""

    rays: Int64

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        used, kept = set(self.rays[taken].tolist()), []
        for proposal in super().propose(taken, wanted, room):
            free = []
            for place, ray in zip(proposal.tolist(), self.rays[proposal].tolist(), strict=True):
                if ray not in used:
                    used.add(ray)
                    free.append(place)
            kept.append(np.array(free, np.int64))
        return kept


@dataclass(eq=False, kw_only=True)
class StealthyDetachProblem(DetachProblem):
    """It proposes only points that the density check would not miss."""

    limit: MissingReturnLimit

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        self.limit.start(taken)
        kept = [np.zeros(0, np.int64) for _ in wanted]
        for attempt in range(ATTEMPTS):
            size = np.array([len(each) for each in kept], np.int64)
            still = np.maximum(wanted - size, 0)
            if not still.any():
                break
            try:
                proposals = super().propose(np.concatenate([taken, *kept]), still, room - size)
            except NoGradientError:
                if attempt == 0:
                    raise
                break
            for number, proposal in enumerate(proposals):
                bounds = np.flatnonzero(np.diff(self._group[proposal])) + 1
                for members in np.split(proposal, bounds) if len(proposal) else []:
                    if self.limit.take(members):
                        kept[number] = np.concatenate([kept[number], members])
                    else:
                        self._gain[members] = 0.0
        return kept
