"""The objects of a scene as instances and annotations, each linked to its neighbours in time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.export.nuscenes.tables import Record, TableWriter, token_of
from advpipe.stages.export.recorded import RecordedFrame

CATEGORIES = {
    "car": "vehicle.car",
    "truck": "vehicle.truck",
    "cyclist": "vehicle.bicycle/cycle.with_rider",
    "pedestrian": "human.pedestrian.adult",
}
"""Category of each class, with its attribute after a slash."""

Named = tuple[str, str, Float64, int]
"""Id, category with attribute, box in the map, and LiDAR points."""


class SceneObjects:
    """Writes the annotations of a scene; an annotation waits for the next of its instance.

    counts: points by the annotation's token, kept over bags: an adversarial bag tells those of the clean one,
    since evaluations leave out objects without points. names: categories and attributes so far.
    """

    def __init__(self, scene: str, writer: TableWriter, counts: dict[str, int]) -> None:
        self._scene, self._writer, self._counts = scene, writer, counts
        self._waiting: dict[str, Record] = {}
        self._first: dict[str, tuple[str, str]] = {}
        self._lengths: Counter[str] = Counter()
        self.categories: set[str] = set()
        self.attributes: set[str] = set()
        self.count = 0

    def add(self, frame: RecordedFrame, sample: str) -> None:
        """The objects of a frame, those that count neither way too."""
        used: Counter[str] = Counter()
        for row, (name, kind, box, points) in enumerate(_objects(frame)):
            key = name or f"{sample}/{row}"
            used[key] += 1
            if used[key] > 1:  # ids are not unique in every recording
                key = f"{key}#{used[key]}"
            self._annotate(key, kind, box, points, sample)

    def finish(self) -> None:
        """Write the last annotation of each instance, and the instances."""
        for instance, last in self._waiting.items():
            self._writer.add("sample_annotation", last)
            category, first = self._first[instance]
            self._writer.add(
                "instance",
                {
                    "token": instance,
                    "category_token": token_of("category", category),
                    "nbr_annotations": self._lengths[instance],
                    "first_annotation_token": first,
                    "last_annotation_token": last["token"],
                },
            )

    def _annotate(self, key: str, kind: str, box: Float64, points: int, sample: str) -> None:
        category, _, attribute = kind.partition("/")
        instance = token_of("instance", self._scene, key)
        token = token_of("annotation", instance, sample)
        self.categories.add(category)
        self.attributes |= {attribute} - {""}
        before = self._waiting.get(instance)
        if before is None:
            self._first[instance] = (category, token)
        else:
            self._writer.add("sample_annotation", {**before, "next": token})
        x_m, y_m, z_m, length_m, width_m, height_m, yaw_rad = map(float, box)
        self._waiting[instance] = {
            "token": token,
            "sample_token": sample,
            "instance_token": instance,
            "visibility_token": "",
            "attribute_tokens": [token_of("attribute", attribute)] if attribute else [],
            "translation": [x_m, y_m, z_m],
            "size": [width_m, length_m, height_m],
            "rotation": [math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)],
            "prev": before["token"] if before else "",
            "next": "",
            "num_lidar_pts": self._counts.setdefault(token, points),
            "num_radar_pts": 0,
        }
        self._lengths[instance] += 1
        self.count += 1


def _objects(frame: RecordedFrame) -> Iterator[Named]:
    kinds = [CATEGORIES[CLASSES[label]] for label in frame.boxes.labels]
    yield from zip(
        frame.boxes.ids, kinds, frame.boxes.geometry, np.asarray(frame.lidar_points).tolist(), strict=True
    )
    ignored = frame.ignored
    points = np.asarray(frame.ignored_lidar_points).tolist()
    yield from zip(ignored.ids, ignored.class_names, ignored.geometry, points, strict=True)
