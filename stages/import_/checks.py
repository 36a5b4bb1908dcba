"""Checks that every imported drive has to pass, whatever its form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.message_bounds import LATEST_NS
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame

FASTEST_MPS = 100.0
"""No vehicle on a road is faster; poses that imply more belong to another drive or have another unit."""

_FARTHEST_M = 1000.0
"""No LiDAR of a vehicle measures farther: most points beyond it mean another unit."""

_NEAR_M, _ENOUGH_BOXES, _FEW = 20.0, 20, 0.3
"""Labelled objects this near have points; fewer than this share of that many means another frame or unit."""

_FEW_BOXES = 3
"""A drive with fewer near boxes than `_ENOUGH_BOXES` is judged at its end, if it has this many."""

_LONGEST_BOX_M = 30.0
"""No road user is longer, road trains aside: a box beyond it has another unit."""

_ABOVE_GROUND_M = 0.3
"""Points lower in a box may be of the ground, which is everywhere."""

_FLATTEST_SHARE = 0.5
"""A sweep spreads less than this along its vertical, as a share of what it spreads along the others."""

_JUMP_M = 5.0
"""Between poses, below which time stamps may simply be coarse."""


@dataclass
class DriveChecks:
    """Checks frame after frame; it remembers what it must of the last one.

    are_related: whether neighbouring frames belong together. warnings: sentences, each once. near_boxes,
    hit_boxes: labelled boxes near the LiDAR, and those of them that hold points.
    """

    are_related: bool
    warnings: list[str] = field(default_factory=list)
    near_boxes: int = 0
    hit_boxes: int = 0
    _last: tuple[str, int, dict[str, Float64]] | None = None

    def check(self, frame: DriveFrame) -> None:
        """Raises AdvpipeError, one line, for a frame that cannot be right."""
        if not 0 <= frame.stamp_ns <= LATEST_NS:
            raise AdvpipeError(
                f"{frame.name}: its time {frame.stamp_ns} ns since 1970 is outside of what ROS can stamp "
                "(1970 to 2038); it has another unit"
            )
        if self._last is not None and frame.stamp_ns <= self._last[1]:
            raise AdvpipeError(
                f"{frame.name}: its time {frame.stamp_ns} ns is not after that of {self._last[0]} "
                f"({self._last[1]} ns); sort the frames by time"
            )
        for name, vehicle in frame.vehicles.items():
            for problem in _problems(name, vehicle):
                raise AdvpipeError(f"{frame.name}: {problem}")
            self._check_pose(frame, name, vehicle)
            for lidar, cloud in vehicle.clouds.items():
                for warning in _doubts(cloud):
                    self._warn(f"{lidar} of {name}: {warning}.")
            self._check_boxes(vehicle)
        poses = {n: v.map_SE3_base for n, v in frame.vehicles.items() if v.map_SE3_base is not None}
        self._last = (frame.name, frame.stamp_ns, poses)

    def _check_pose(self, frame: DriveFrame, name: str, vehicle: VehicleFrame) -> None:
        pose = vehicle.map_SE3_base
        if pose is None or self._last is None or name not in self._last[2] or not self.are_related:
            return
        moved_m = float(np.linalg.norm(pose[:3, 3] - self._last[2][name][:3, 3]))
        elapsed_s = (frame.stamp_ns - self._last[1]) / 1e9
        if moved_m > _JUMP_M and moved_m > FASTEST_MPS * elapsed_s:
            raise AdvpipeError(
                f"{frame.name}: the pose of {name} jumps {moved_m:.1f} m in {elapsed_s:.2f} s since "
                f"{self._last[0]}; import one drive at a time, with poses in metres"
            )

    def _check_boxes(self, vehicle: VehicleFrame) -> None:
        """Count those near the LiDAR, and those with points; a dozen frames show whether both fit."""
        lidar = vehicle.boxes_frame.rpartition("/")[2]
        if vehicle.boxes is None or lidar not in vehicle.clouds or self.near_boxes >= _ENOUGH_BOXES:
            return
        near = vehicle.boxes.geometry[np.hypot(*vehicle.boxes.geometry[:, :2].T) < _NEAR_M]
        raised = near + np.array([0, 0, _ABOVE_GROUND_M / 2, 0, 0, -_ABOVE_GROUND_M, 0])
        self.near_boxes += len(near)
        self.hit_boxes += int((count_points(xyz(vehicle.clouds[lidar]), raised) > 0).sum())
        if self.near_boxes >= _ENOUGH_BOXES:
            self._judge_boxes()

    def finish(self) -> None:
        """Judge what a short drive has of boxes, after its last frame."""
        if _FEW_BOXES <= self.near_boxes < _ENOUGH_BOXES:
            self._judge_boxes()

    def _judge_boxes(self) -> None:
        if self.hit_boxes < _FEW * self.near_boxes:
            self._warn(
                f"Of {self.near_boxes} labelled boxes within {_NEAR_M:g} m, {self.hit_boxes} hold points; "
                "boxes and clouds may differ in frame, unit, axes (x forward, y left, z up), or time."
            )

    def _warn(self, warning: str) -> None:
        if warning not in self.warnings:
            self.warnings.append(warning)


def _problems(name: str, vehicle: VehicleFrame) -> Iterator[str]:
    for lidar, cloud in vehicle.clouds.items():
        if not len(cloud):
            fix = f"restore it, or choose frames without it ({option_name('frames', 'start:stop:step')})"
            yield f"the cloud of {name}/{lidar} has no points; {fix}"
            continue
        points = xyz(cloud)
        finite = points[np.isfinite(points).all(axis=1)]
        if not len(finite):
            yield (
                f"the cloud of {name}/{lidar} has no finite point; restore it, or give it the columns and "
                "the number type that the form has"
            )
        elif np.median(np.abs(finite)) > _FARTHEST_M:
            distance_m = np.median(np.linalg.norm(finite, axis=1))
            yield (
                f"the points of {name}/{lidar} lie {distance_m:,.0f} m away in the median; give metres, in "
                "the sensor's own frame (or name the columns)"
            )
    boxes = vehicle.boxes
    if boxes is not None and len(boxes):
        sizes = boxes.geometry[:, 3:6]
        if not np.isfinite(boxes.geometry).all():
            yield "a box has a coordinate that is not finite"
        elif (sizes <= 0).any() or (sizes > _LONGEST_BOX_M).any():
            size_m = sizes[(sizes <= 0) | (sizes > _LONGEST_BOX_M)][0]
            unit = f", and road users are up to {_LONGEST_BOX_M:g} m long; give metres" if size_m > 0 else ""
            yield f"a box has the size {size_m:g} m{unit}"
    pose = vehicle.map_SE3_base
    if pose is not None and not _is_rigid(pose):
        yield "its pose is not a rotation and a translation"


def _is_rigid(pose: Float64) -> bool:
    rotation = pose[:3, :3]
    return bool(
        np.isfinite(pose).all()
        and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3)
        and np.linalg.det(rotation) > 0
    )


def _doubts(cloud: Cloud) -> Iterator[str]:
    """What is odd about a cloud but may be right."""
    if not len(cloud):
        return
    with np.errstate(invalid="ignore"):
        is_bright = bool((cloud["intensity"] > 1.0).any())
    if is_bright:
        yield (
            "intensities exceed 1, which detectors take for the strongest return; give "
            "--scale-intensity (0.00392157 for 0 to 255)"
        )
    spread_m = [_spread_m(cloud[axis]) for axis in "xyz"]
    flattest = int(np.argmin(spread_m))
    if flattest != 2 and spread_m[flattest] < _FLATTEST_SHARE * spread_m[2]:
        yield (
            f"it is flattest along {'xyz'[flattest]}: its axes may not be x forward, y left, z up "
            "(--columns for .bin and .npy)"
        )


def _spread_m(values: npt.NDArray[np.float32]) -> float:
    """Between the 5 and 95 % quantiles of the finite ones."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(np.percentile(finite, [5, 95]))) if len(finite) else 0.0
