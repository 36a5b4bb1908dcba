"""The folder of a nuScenes data set, and what its tables say about one scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from advpipe.pipeline.core.document import Document
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.json_array import Record, read_json_array
from advpipe.stages.import_.nuscenes.records import (
    AnnotationRecord,
    InstanceRecord,
    MountRecord,
    NamedRecord,
    PosedRecord,
    SampleDataRecord,
    SampleRecord,
    SensorRecord,
)
from advpipe.stages.import_.nuscenes.table import HINT, has_value, records_of

NEEDED = (
    "scene",
    "sample",
    "sample_data",
    "sample_annotation",
    "instance",
    "category",
    "attribute",
    "calibrated_sensor",
    "sensor",
    "ego_pose",
)
"""Tables that an import reads; map, log and visibility may be missing."""

LIDAR_CHANNEL = "LIDAR_TOP"

Model = TypeVar("Model", bound=Document)


@dataclass(frozen=True)
class SceneRecords:
    """All that the tables say about the key frames of one scene.

    sweeps: of the LiDAR, one a sample, in time order. poses: of the vehicle, by token. annotations: by the
    sample's token; None where the data set is not labelled. categories: by the instance's token. attributes:
    by token.
    """

    name: str
    sweeps: list[SampleDataRecord]
    sample_stamps_us: Mapping[str, int]
    mount: MountRecord
    poses: Mapping[str, PosedRecord]
    annotations: Mapping[str, list[AnnotationRecord]] | None
    categories: Mapping[str, str]
    attributes: Mapping[str, str]


@dataclass(frozen=True)
class NuscenesTables:
    """data: the folder with `samples/`. tables: its folder of tables, such as `v1.0-mini`."""

    data: Path
    tables: Path

    @classmethod
    def find(cls, source: Path) -> NuscenesTables:
        """The tables of a data set's folder or of a version's. Raises UsageError if there are none."""
        if not source.is_dir():
            raise UsageError(f"{source} is not a folder; give the one that holds v1.0-mini and samples")
        if (source / "scene.json").is_file():
            found = cls(source.resolve().parent, source)
        else:
            versions = sorted(path.parent for path in source.glob("*/scene.json"))
            if not versions:
                raise UsageError(
                    f"{source} holds no tables of nuScenes (no */scene.json); give the folder that holds "
                    "v1.0-mini or v1.0-trainval, and samples"
                )
            if len(versions) > 1:
                names = ", ".join(path.name for path in versions)
                raise UsageError(f"{source} has the tables of {names}; give one of these folders")
            found = cls(source, versions[0])
        missing = [f"{name}.json" for name in NEEDED if not found.file(name).is_file()]
        if missing:
            raise UsageError(f"{found.tables} lacks {', '.join(missing)}; unpack the metadata again")
        return found

    def file(self, table: str) -> Path:
        """The file of a table."""
        return self.tables / f"{table}.json"

    def scene_tokens(self) -> dict[str, str]:
        """The tokens of the scenes by their names. Raises UsageError if there is none."""
        tokens = {record.name: record.token for record in records_of(self.file("scene"), NamedRecord)}
        if not tokens:
            raise UsageError(f"{self.file('scene')} holds no scene")
        return tokens

    def category_names(self) -> list[str]:
        """The names of all categories."""
        return [record.name for record in records_of(self.file("category"), NamedRecord)]

    def scene(self, name: str, token: str) -> SceneRecords:
        """Read what the tables say about a scene; the large ones are read once, record by record."""
        samples = self._by_token("sample", SampleRecord, "scene_token", [token])
        if not samples:
            raise UsageError(f"{self.file('sample')} holds no sample of {name}")
        mounts = self._lidar_mounts()
        sweeps = self._sweeps(samples, mounts)
        used = {sweep.calibrated_sensor_token for sweep in sweeps}
        if len(used) > 1:
            raise UsageError(f"{self.file('sample_data')}: {LIDAR_CHANNEL} has {len(used)} mounts in {name}")
        poses = self._by_token("ego_pose", PosedRecord, "token", [sweep.ego_pose_token for sweep in sweeps])
        for sweep in sweeps:
            if sweep.ego_pose_token not in poses:
                raise UsageError(f"{self.file('ego_pose')} lacks the pose {sweep.ego_pose_token}")
        annotations = self._annotations(samples)
        instances = {each.instance_token for group in (annotations or {}).values() for each in group}
        return SceneRecords(
            name,
            sweeps,
            {sample.token: sample.timestamp for sample in samples.values()},
            mounts[used.pop()],
            poses,
            annotations,
            self._categories(instances),
            {record.token: record.name for record in records_of(self.file("attribute"), NamedRecord)},
        )

    def _by_token(self, table: str, model: type[Model], key: str, values: Iterable[str]) -> dict[str, Model]:
        """The records of a table whose key has one of these values, by their tokens."""
        found = records_of(self.file(table), model, has_value(key, values))
        return {str(record.token): record for record in found}  # type: ignore[attr-defined]

    def _lidar_mounts(self) -> dict[str, MountRecord]:
        sensors = [
            record.token
            for record in records_of(self.file("sensor"), SensorRecord)
            if record.channel == LIDAR_CHANNEL
        ]
        if not sensors:
            raise UsageError(f"{self.file('sensor')} has no {LIDAR_CHANNEL}")
        return self._by_token("calibrated_sensor", MountRecord, "sensor_token", sensors)

    def _sweeps(
        self, samples: Mapping[str, SampleRecord], mounts: Mapping[str, MountRecord]
    ) -> list[SampleDataRecord]:
        """The LiDAR's key frames of a scene in time order, one a sample."""
        is_of_scene, is_of_lidar = (
            has_value("sample_token", samples),
            has_value("calibrated_sensor_token", mounts),
        )

        def is_wanted(record: Record) -> bool:
            return record.get("is_key_frame") is True and is_of_scene(record) and is_of_lidar(record)

        sweeps = list(records_of(self.file("sample_data"), SampleDataRecord, is_wanted))
        by_sample = {sweep.sample_token: sweep for sweep in sweeps}
        if len(by_sample) < len(sweeps):
            raise UsageError(
                f"{self.file('sample_data')}: a sample has several key frames of {LIDAR_CHANNEL}"
            )
        for token in samples:
            if token not in by_sample:
                raise UsageError(
                    f"{self.file('sample_data')}: the sample {token} has no key frame of {LIDAR_CHANNEL}"
                )
        return sorted(sweeps, key=lambda sweep: sweep.timestamp)

    def _annotations(self, samples: Mapping[str, SampleRecord]) -> dict[str, list[AnnotationRecord]] | None:
        """By the sample's token; None for a data set without any label, such as nuScenes' test split."""
        file = self.file("sample_annotation")
        found: dict[str, list[AnnotationRecord]] = {token: [] for token in samples}
        for record in records_of(file, AnnotationRecord, has_value("sample_token", samples)):
            found[record.sample_token].append(record)
        if not any(found.values()) and next(read_json_array(file, HINT), None) is None:
            return None
        return found

    def _categories(self, instances: Iterable[str]) -> dict[str, str]:
        """The names of the categories of instances, by the instances' tokens."""
        names = {record.token: record.name for record in records_of(self.file("category"), NamedRecord)}
        found = self._by_token("instance", InstanceRecord, "token", instances)
        for token in instances:
            if token not in found or found[token].category_token not in names:
                raise AdvpipeError(
                    f"{self.file('instance')}: no instance {token} with a known category, though "
                    "sample_annotation.json refers to it"
                )
        return {token: names[record.category_token] for token, record in found.items()}
