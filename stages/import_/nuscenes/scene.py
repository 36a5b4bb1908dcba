"""A scene of nuScenes as a drive."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.stages.import_.byte_intensity import STRONGEST, check_intensity
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.labelled import LabelledObject, sort_objects, track_velocities
from advpipe.stages.import_.named_files import named_file
from advpipe.stages.import_.nuscenes.records import AnnotationRecord, PosedRecord, SampleDataRecord
from advpipe.stages.import_.nuscenes.tables import LIDAR_CHANNEL, NuscenesTables, SceneRecords
from advpipe.stages.import_.point_files import cloud_of_columns, read_floats

COLUMNS = ("x", "y", "z", "intensity", "ring")
"""Of a point in a .pcd.bin file, float32 each."""

_OWN = VehicleTopics()


class NuscenesScene:
    """The key frames of a scene: clouds as they lie in the files, boxes in the map's frame."""

    are_related = True

    def __init__(
        self,
        tables: NuscenesTables,
        records: SceneRecords,
        class_map: Mapping[str, str],
        scale_intensity: float | None,
    ) -> None:
        self._tables, self._records, self._class_map = tables, records, class_map
        self._scale_intensity = scale_intensity
        self.name = records.name
        self.static_transforms = [
            (_OWN.base_frame, _OWN.lidar_frame, _matrix(records.mount, "calibrated_sensor"))
        ]

    @property
    def frame_count(self) -> int:
        return len(self._records.sweeps)

    @property
    def notes(self) -> Sequence[str]:
        """How the scene was understood."""
        notes = [
            f"{LIDAR_CHANNEL} keeps its axes: in nuScenes, x points to the right and y forward.",
            "Only key frames, which are labelled (2 Hz in nuScenes), are imported.",
        ]
        if self._records.annotations is None:
            notes.append(f"{self._tables.tables.name} holds no label.")
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The key frames from the index `first` on."""
        for sweep in self._records.sweeps[first:]:
            pose = _matrix(self._records.poses[sweep.ego_pose_token], "ego_pose")
            vehicle = self._vehicle(sweep, pose)
            file = self._tables.data / sweep.filename
            name = file.name.removesuffix(".bin").removesuffix(".pcd")
            yield DriveFrame(str(file), sweep.timestamp * 1000, {"ego": vehicle}, name)

    def class_names(self) -> Collection[str]:
        """The categories of the data set's table, and those with an attribute behind a slash."""
        categories = self._tables.category_names()
        return [
            *categories,
            *(f"{category}/{each}" for category in categories for each in self._records.attributes.values()),
        ]

    def _vehicle(self, sweep: SampleDataRecord, map_SE3_base: Float64) -> VehicleFrame:
        clouds = {"lidar": self._cloud(sweep)}
        if self._records.annotations is None:
            return VehicleFrame(clouds, map_SE3_base=map_SE3_base)
        annotations = self._records.annotations[sweep.sample_token]
        found = sort_objects(map(self._object, annotations), self._class_map)
        return VehicleFrame(
            clouds,
            found.boxes,
            MAP_FRAME,
            found.ignored,
            map_SE3_base=map_SE3_base,
            lidar_points=found.lidar_points,
        )

    def _cloud(self, sweep: SampleDataRecord) -> Cloud:
        file = named_file(self._tables.data, sweep.filename, f"{self._tables.tables.name}/sample_data.json")
        table = read_floats(file, len(COLUMNS))
        if self._scale_intensity is None and len(table):
            check_intensity(file, table[:, 3], "nuScenes")
        if not np.all((table[:, 4] >= 0) & (table[:, 4] < 1 << 16)):
            raise AdvpipeError(
                f"{file}: its fifth column is no ring; points of nuScenes are x, y, z, intensity, ring"
            )
        cloud = cloud_of_columns(table, COLUMNS)
        if self._scale_intensity is None:
            cloud["intensity"] /= np.float32(STRONGEST)
        else:
            cloud["intensity"] *= np.float32(self._scale_intensity)
        return cloud

    def _object(self, annotation: AnnotationRecord) -> LabelledObject:
        attributes = sorted(self._records.attributes.get(each, "") for each in annotation.attribute_tokens)
        category = self._records.categories[annotation.instance_token]
        named = next(
            (f"{category}/{each}" for each in attributes if f"{category}/{each}" in self._class_map), ""
        )
        width_m, length_m, height_m = annotation.size
        return LabelledObject(
            named or category,
            annotation.instance_token,
            (*annotation.translation, length_m, width_m, height_m, annotation.yaw_rad()),
            self._velocities[annotation.token],
            annotation.num_lidar_pts,
        )

    @cached_property
    def _velocities(self) -> Mapping[str, tuple[float, ...]]:
        """In the map's frame, by the annotation's token."""
        tracks: dict[str, list[AnnotationRecord]] = defaultdict(list)
        for sweep in self._records.sweeps:
            for annotation in (self._records.annotations or {}).get(sweep.sample_token, ()):
                tracks[annotation.instance_token].append(annotation)
        found: dict[str, tuple[float, ...]] = {}
        for track in tracks.values():
            stamps_us = np.array([self._records.sample_stamps_us[each.sample_token] for each in track])
            velocities = track_velocities(stamps_us * 1000, [each.translation for each in track])
            found.update(zip((each.token for each in track), map(tuple, velocities.tolist()), strict=True))
        return found


def _matrix(record: PosedRecord, table: str) -> Float64:
    try:
        return record.matrix()
    except ValueError:
        raise AdvpipeError(f"{table}.json: the rotation of {record.token} is no quaternion") from None
