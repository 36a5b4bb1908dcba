"""A sensor log of Argoverse 2 as a drive."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.import_.av2.annotations import read_annotations
from advpipe.stages.import_.av2.calibration import poses_of, read_lenses, read_mounts
from advpipe.stages.import_.av2.feather import POSE, STAMP, read_feather
from advpipe.stages.import_.byte_intensity import STRONGEST, check_intensity
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.labelled import sort_objects

AXLE_HEIGHT_M = 0.33
"""Of the rear axle, where the ego vehicle's frame has its origin, above the ground."""

_OWN = VehicleTopics()
_POINT = ("x", "y", "z", "intensity", "laser_number", "offset_ns")


class Av2Log:
    """The sweeps of a log: points and boxes as they lie in the files, in the ego vehicle's frame."""

    are_related = True

    def __init__(
        self,
        folder: Path,
        class_map: Mapping[str, str],
        axle_height_m: float = AXLE_HEIGHT_M,
        scale_intensity: float | None = None,
    ) -> None:
        self.name, self._folder, self._class_map = folder.resolve().name, folder, class_map
        self._scale_intensity = np.float32(1 / STRONGEST if scale_intensity is None else scale_intensity)
        self._axle_height_m, self._is_scale_given = axle_height_m, scale_intensity is not None
        self._base_SE3_ego = se3(np.eye(3), [0, 0, axle_height_m])
        self._city_SE3_ego = _read_poses(folder / "city_SE3_egovehicle.feather")
        self._sweeps = _sweep_files(folder / "sensors" / "lidar")
        self._lenses = read_lenses(folder)
        self._mounts = read_mounts(folder)
        self._labels = read_annotations(folder / "annotations.feather", self._city_SE3_ego)
        self._unlabelled = 0
        if self._labels is not None:
            self._keep_labelled(self._labels)
        poses = folder / "city_SE3_egovehicle.feather"
        for stamp_ns in self._sweeps:
            if stamp_ns not in self._city_SE3_ego:
                raise UsageError(f"{poses} has no pose at {stamp_ns} ns, the stamp of a sweep")
        self._stamps_ns = sorted(self._sweeps)

    @property
    def frame_count(self) -> int:
        return len(self._stamps_ns)

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        """The frame of clouds and boxes, which is the ego vehicle's, and in it the mounted sensors."""
        mounts = [(_OWN.lidar_frame, _OWN.sensor_frame(name), pose) for name, pose in self._mounts.items()]
        return [(_OWN.base_frame, _OWN.lidar_frame, self._base_SE3_ego), *mounts]

    @property
    def notes(self) -> Sequence[str]:
        """How the log was understood."""
        up_m = self._mounts["up_lidar"][:3, 3]
        notes = [
            "The clouds of both LiDARs are one, in the ego vehicle's frame. Its origin is the middle of the "
            f"rear axle, {self._axle_height_m:g} m above the ground ({option_name('lidar_height')}); rays "
            f"begin at up_lidar, x {up_m[0]:.2f} m, z {up_m[2]:.2f} m in it.",
        ]
        if self._labels is None:
            notes.append("The log holds no annotations.feather, and so no label.")
        if self._unlabelled:
            notes.append(f"Sweeps without labels are left out: {self._unlabelled}.")
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The sweeps from the index `first` on."""
        for stamp_ns in self._stamps_ns[first:]:
            file = self._sweeps[stamp_ns]
            yield DriveFrame(str(file), stamp_ns, {"ego": self._vehicle(file, stamp_ns)}, file.stem)

    def class_names(self) -> Collection[str]:
        """The categories of the log's labels."""
        return {each.class_name for labels in (self._labels or {}).values() for each in labels}

    def _vehicle(self, file: Path, stamp_ns: int) -> VehicleFrame:
        clouds = {"lidar": self._cloud(file)}
        pose = self._city_SE3_ego[stamp_ns] @ se3(np.eye(3), [0, 0, -self._axle_height_m])
        if self._labels is None:
            return VehicleFrame(clouds, map_SE3_base=pose, cameras=self._lenses)
        found = sort_objects(self._labels[stamp_ns], self._class_map)
        return VehicleFrame(
            clouds,
            found.boxes,
            _OWN.lidar_frame,
            found.ignored,
            map_SE3_base=pose,
            cameras=self._lenses,
            lidar_points=found.lidar_points,
        )

    def _cloud(self, file: Path) -> Cloud:
        columns = read_feather(file, _POINT)
        intensity, ring = columns["intensity"], columns["laser_number"]
        if len(ring) and not 0 <= ring.min() <= ring.max() < 1 << 16:
            raise AdvpipeError(f"{file}: lasers from {ring.min()} to {ring.max()}, where Argoverse 2 has 64")
        if len(ring) and not self._is_scale_given:
            check_intensity(file, intensity, "Argoverse 2")
        cloud = np.zeros(len(ring), POINT_DTYPE)
        for name in ("x", "y", "z"):
            cloud[name] = columns[name]
        cloud["intensity"] = intensity.astype(np.float32) * self._scale_intensity
        cloud["ring"] = ring
        cloud["time"] = columns["offset_ns"] / 1e9
        return cloud

    def _keep_labelled(self, labels: Mapping[int, object]) -> None:
        """Leave out sweeps without labels, of which nobody knows what is around."""
        for stamp_ns in labels:
            if stamp_ns not in self._sweeps:
                missing = self._folder / "sensors" / "lidar" / f"{stamp_ns}.feather"
                raise UsageError(f"{missing} is missing, though annotations.feather labels it")
        if not labels:
            raise UsageError(f"{self._folder / 'annotations.feather'} holds no label")
        every = len(self._sweeps)
        self._sweeps = {stamp: file for stamp, file in self._sweeps.items() if stamp in labels}
        self._unlabelled = every - len(self._sweeps)


def _read_poses(file: Path) -> Mapping[int, Float64]:
    if not file.is_file():
        raise UsageError(f"{file} is missing; complete the download of the log")
    columns = read_feather(file, (STAMP, *POSE))
    return dict(zip(columns[STAMP].tolist(), poses_of(columns, file), strict=True))


def _sweep_files(folder: Path) -> dict[int, Path]:
    """The files of sweeps by their stamps in nanoseconds."""
    files = sorted(folder.glob("*.feather"))
    if not files:
        raise UsageError(
            f"{folder} holds no sweep (<timestamp_ns>.feather); complete the download of the log"
        )
    for file in files:
        if not (file.stem.isascii() and file.stem.isdigit()):
            raise UsageError(f"{file} is not named by a time stamp in nanoseconds, as sweeps are")
    return {int(file.stem): file for file in files}
