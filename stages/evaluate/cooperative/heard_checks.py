"""Checks that could find false objects in CPMs: free space, other witnesses, and what a report leaves out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.box_frustum import box_frustums
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.evaluate.cooperative.heard_scenes import HeardScene, box_in_lidar

SAME_M = 3.0
"""Two reports within this distance are of the same object."""
CORE = 0.7
"""Share of a box's size that counts as its core: places and sizes are not exact."""
FEWEST_RAYS, FREE_SHARE = 8, 0.8
"""Space is free where so many returns, and this share of those through the core, lie behind it."""
ITSELF_M = 4.0
"""An object whose centre is so near to the LiDAR is the vehicle itself."""
WITNESS_M = 40.0
"""A station within this distance of a place would perceive an object there, unless another hides it."""
FEWEST_WITNESSES = 2
OMISSION_M = 25.0
"""The same for an object that a report leaves out."""

Bool = npt.NDArray[np.bool_]


def in_free_space(scene: HeardScene) -> Bool:
    """(H,) whether the own LiDAR sees through the core of each heard object; never through the vehicle
    itself, of which others report, too."""
    found = np.zeros(len(scene.heard), bool)
    boxes = {
        index: box
        for index, one in enumerate(scene.heard)
        if (box := box_in_lidar(one, scene.time_ns, scene.lidar_SE3_map)) is not None
        and np.hypot(box[0], box[1]) > ITSELF_M
    }
    if not len(scene.cloud_m) or not boxes:
        return found
    cores = np.array(list(boxes.values()))
    cores[:, 3:6] *= CORE
    for index, frustum in zip(boxes, box_frustums(scene.cloud_m, cores), strict=True):
        found[index] = len(frustum.range_m) >= FEWEST_RAYS and frustum.penetration >= FREE_SHARE
    return found


def without_witnesses(scene: HeardScene) -> Bool:
    """(H,) whether nobody confirms a heard object, although `FEWEST_WITNESSES` others are near it.

    Witnesses are the vehicle itself and other stations that report objects. An object is confirmed by another
    station's report, by a station in the map at its place, or by points of the own LiDAR on a road user.
    """
    reporters = np.array([one.station_id for one in scene.heard])
    places_m, known_m = scene.heard_m, scene.entries_m
    speaking = set(reporters.tolist())
    where_m = {one.station_id: np.array([one.x_m, one.y_m]) for one in scene.entries}
    seen_m = scene.users[scene.points >= MIN_POINTS, :2]
    found = np.zeros(len(scene.heard), bool)
    for index, place_m in enumerate(places_m):
        others = [where_m[each] for each in speaking - {int(reporters[index])} if each in where_m]
        witnesses = sum(_near(np.array([at_m]), place_m, WITNESS_M).any() for at_m in [scene.at_m, *others])
        reports_m = places_m[reporters != reporters[index]]
        confirmed = any(
            _near(each_m, place_m, SAME_M).any() for each_m in (reports_m, known_m, seen_m, scene.at_m[None])
        )
        found[index] = witnesses >= FEWEST_WITNESSES and not confirmed
    return found


def omitting(scene: HeardScene) -> dict[int, bool]:
    """By station that reports objects: whether it leaves out one near it that the own LiDAR sees and another
    station reports."""
    reporters = np.array([one.station_id for one in scene.heard])
    places_m = scene.heard_m
    where_m = {one.station_id: np.array([one.x_m, one.y_m]) for one in scene.entries}
    seen_m = scene.users[scene.points >= MIN_POINTS, :2]
    found = {}
    for station in sorted(set(reporters.tolist()) & where_m.keys()):
        own_m, others_m = places_m[reporters == station], places_m[reporters != station]
        found[station] = any(
            np.hypot(*(at_m - where_m[station])) > SAME_M  # not the station itself
            and _near(others_m, at_m, SAME_M).any()
            and not _near(own_m, at_m, SAME_M).any()
            for at_m in seen_m[_near(seen_m, where_m[station], OMISSION_M)]
        )
    return found


def _near(places_m: Float64, place_m: Float64, within_m: float) -> Bool:
    """(P,) which places (P, 2) are within a distance of one (2,)."""
    near: Bool = np.hypot(*(places_m.reshape(-1, 2) - place_m).T) <= within_m
    return near
