"""The labels of an Argoverse 2 log, by the time stamp of the sweep that they belong to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.transforms import Float64, yaw_of
from advpipe.stages.import_.av2.calibration import poses_of
from advpipe.stages.import_.av2.feather import POSE, STAMP, Columns, read_feather
from advpipe.stages.import_.labelled import LabelledObject, track_velocities

_COLUMNS = (
    STAMP,
    "track_uuid",
    "category",
    "length_m",
    "width_m",
    "height_m",
    *POSE,
    "num_interior_pts",
)


def read_annotations(
    file: Path, city_SE3_ego: Mapping[int, Float64]
) -> Mapping[int, list[LabelledObject]] | None:
    """The objects in the ego vehicle's frame, by the sweep's stamp; None where the log is not labelled.

    Velocities are differences of a track's positions in the city, along the axes of the ego vehicle. Raises
    UsageError for a label at an instant without a pose.
    """
    if not file.is_file():
        return None
    columns = read_feather(file, _COLUMNS)
    stamps = columns[STAMP].tolist()
    for stamp_ns in set(stamps):
        if stamp_ns not in city_SE3_ego:
            raise UsageError(f"{file} labels {stamp_ns} ns, at which city_SE3_egovehicle.feather has no pose")
    ego_SE3_objects = poses_of(columns, file)
    velocities = _velocities(columns, ego_SE3_objects, city_SE3_ego)
    sizes_m = np.stack([columns[name] for name in ("length_m", "width_m", "height_m")], axis=1)
    found: dict[int, list[LabelledObject]] = defaultdict(list)
    for row, stamp_ns in enumerate(stamps):
        pose = ego_SE3_objects[row]
        box = (*pose[:3, 3].tolist(), *sizes_m[row].tolist(), yaw_of(pose))
        found[stamp_ns].append(
            LabelledObject(
                str(columns["category"][row]),
                str(columns["track_uuid"][row]),
                box,
                tuple(velocities[row].tolist()),
                int(columns["num_interior_pts"][row]),
            )
        )
    return found


def _velocities(columns: Columns, ego_SE3_objects: Float64, city_SE3_ego: Mapping[int, Float64]) -> Float64:
    """Velocities (K, 3) along the axes of the ego vehicle at the K rows' instants."""
    stamps = columns[STAMP]
    city_SE3_egos = np.array([city_SE3_ego[stamp] for stamp in stamps.tolist()]).reshape(-1, 4, 4)
    rotations = city_SE3_egos[:, :3, :3]
    positions = np.einsum("nij,nj->ni", rotations, ego_SE3_objects[:, :3, 3]) + city_SE3_egos[:, :3, 3]
    velocities = np.full((len(stamps), 3), np.nan)
    _, tracks = np.unique(columns["track_uuid"], return_inverse=True)
    order = np.lexsort((stamps, tracks))
    for rows in np.split(order, np.flatnonzero(np.diff(tracks[order])) + 1):
        velocities[rows] = track_velocities(stamps[rows], positions[rows])
    along_ego: Float64 = np.einsum("nji,nj->ni", rotations, velocities)
    return along_ego
