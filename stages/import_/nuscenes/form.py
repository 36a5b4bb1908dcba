"""nuScenes' form, which other data sets share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.named_files import chosen_drive
from advpipe.stages.import_.nuscenes.scene import NuscenesScene
from advpipe.stages.import_.nuscenes.tables import NuscenesTables
from advpipe.stages.import_.options import IGNORED, ImportOptions


class NuscenesForm(DriveForm):
    """The published tables (v1.0-mini, v1.0-trainval, v1.0-test) with the LiDAR's key frames.

    Cycles without a rider, trailers, construction and emergency vehicles, and objects that move no wheels of
    their own count neither way, as in nuScenes' own detection benchmark.
    """

    title = "nuScenes: tables v1.0 and LIDAR_TOP"
    licence = "CC-BY-NC-SA-4.0"
    citation = "Caesar et al., nuScenes: A Multimodal Dataset for Autonomous Driving, CVPR 2020"
    takes = ("drive", "scale_intensity", "classes")
    classes: ClassVar[Mapping[str, str]] = {
        "vehicle.car": "car",
        "vehicle.truck": "truck",
        "vehicle.bus.bendy": "truck",
        "vehicle.bus.rigid": "truck",
        "vehicle.bicycle": "cyclist",
        "vehicle.bicycle/cycle.without_rider": IGNORED,
        "vehicle.motorcycle": "cyclist",
        "vehicle.motorcycle/cycle.without_rider": IGNORED,
        "human.pedestrian.adult": "pedestrian",
        "human.pedestrian.child": "pedestrian",
        "human.pedestrian.construction_worker": "pedestrian",
        "human.pedestrian.police_officer": "pedestrian",
    }

    def open(self, source: Path, options: ImportOptions) -> NuscenesScene:
        """Open a scene. Raises UsageError for missing tables, or a scene that is not there."""
        tables = NuscenesTables.find(source)
        tokens = tables.scene_tokens()
        name = chosen_drive(tables.tables, "scene", list(tokens), options.drive)
        records = tables.scene(name, tokens[name])
        return NuscenesScene(tables, records, self.class_map(options), options.scale_intensity)
