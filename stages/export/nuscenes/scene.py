"""One scene in nuScenes' form: its tables, its clouds and its list of splits."""

from __future__ import annotations

import json
from collections.abc import Iterable
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, quaternion_xyzw
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.export.nuscenes.objects import SceneObjects
from advpipe.stages.export.nuscenes.tables import Record, TableWriter, token_of
from advpipe.stages.export.recorded import RecordedFrame

VERSION = "v1.0-trainval"
SPLIT = "advpipe"
"""In splits.json: nuScenes' own splits are lists of its own scenes."""

CHANNEL = "LIDAR_TOP"
STRONGEST = 255
MAP_NAME = "maps/none.png"


class SceneWriter:
    """Writes one bag as a scene. notes: sentences. objects: those written so far."""

    def __init__(self, folder: Path, scene: str, tables: TableWriter, counts: dict[str, int]) -> None:
        self._folder, self._scene, self._tables = folder, scene, tables
        (folder / "samples" / CHANNEL).mkdir(parents=True)
        self.objects = SceneObjects(scene, tables, counts)
        self.stamps_ns: set[int] = set()
        self.notes: set[str] = set()
        self._mounts: dict[bytes, Record] = {}
        self._first = ""
        self._last: tuple[Record, Record] | None = None

    def add(self, frame: RecordedFrame) -> None:
        """Write a frame as a sample."""
        stamp_us = frame.stamp_ns // 1000
        if frame.stamp_ns % 1000:
            self.notes.add("Stamps are cut to microseconds.")
        if not frame.has_pose:
            self.notes.add("The bag has no poses: the map's frame is the vehicle's in each sample.")
        if frame.covers_view_only:
            self.notes.add("Only a part of the surroundings is labelled, which this form cannot say.")
        sample = token_of("sample", self._scene, frame.stamp_ns)
        sweep = token_of("sample_data", self._scene, frame.stamp_ns)
        pose = token_of("ego_pose", self._scene, frame.stamp_ns)
        filename = f"samples/{CHANNEL}/{self._scene}__{CHANNEL}__{stamp_us}.pcd.bin"
        _write_cloud(self._folder / filename, frame.cloud)
        self._tables.add("ego_pose", {"token": pose, "timestamp": stamp_us, **_posed(frame.map_SE3_base)})
        before = self._link(sample, sweep)
        records = (
            {
                "token": sample,
                "timestamp": stamp_us,
                "prev": before[0],
                "next": "",
                "scene_token": self._token,
            },
            {
                "token": sweep,
                "sample_token": sample,
                "ego_pose_token": pose,
                "calibrated_sensor_token": self._mount(frame.base_SE3_lidar),
                "timestamp": stamp_us,
                "fileformat": "pcd",
                "is_key_frame": True,
                "height": 0,
                "width": 0,
                "filename": filename,
                "prev": before[1],
                "next": "",
            },
        )
        self._last = records
        self._first = self._first or sample
        self.objects.add(frame, sample)
        self.stamps_ns.add(frame.stamp_ns)

    def finish(self) -> None:
        """Write what is known at the end."""
        last = self._link("", "")[0]
        self.objects.finish()
        self._tables.write(self._whole_tables(last))
        splits = json.dumps({SPLIT: [self._scene]}) + "\n"
        (self._folder / VERSION / "splits.json").write_text(splits, encoding="utf-8")
        _write_map(self._folder / MAP_NAME)

    @property
    def _token(self) -> str:
        return token_of("scene", self._scene)

    def _link(self, sample: str, sweep: str) -> tuple[str, str]:
        """Write the last sample and its cloud, now that their followers are known; returns their tokens."""
        if self._last is None:
            return "", ""
        (old_sample, old_sweep), self._last = self._last, None
        self._tables.add("sample", {**old_sample, "next": sample})
        self._tables.add("sample_data", {**old_sweep, "next": sweep})
        return old_sample["token"], old_sweep["token"]

    def _mount(self, base_SE3_lidar: Float64) -> str:
        """The token of a calibrated sensor with this mount."""
        key = base_SE3_lidar.tobytes()
        token = token_of("calibrated_sensor", self._scene, key.hex())
        self._mounts[key] = {
            "token": token,
            "sensor_token": token_of("sensor", CHANNEL),
            **_posed(base_SE3_lidar),
            "camera_intrinsic": [],
        }
        return token

    def _whole_tables(self, last_sample: str) -> dict[str, list[Record]]:
        log, day = token_of("log", self._scene), min(self.stamps_ns) // 1_000_000_000
        date = datetime.fromtimestamp(day, timezone.utc).date().isoformat()
        levels = ("v0-40", "v40-60", "v60-80", "v80-100")
        return {
            "scene": [
                {
                    "token": self._token,
                    "log_token": log,
                    "nbr_samples": len(self.stamps_ns),
                    "first_sample_token": self._first,
                    "last_sample_token": last_sample,
                    "name": self._scene,
                    "description": "Exported by advpipe",
                }
            ],
            "log": [
                {"token": log, "logfile": "", "vehicle": "ego", "date_captured": date, "location": "advpipe"}
            ],
            "map": [
                {
                    "token": token_of("map"),
                    "category": "semantic_prior",
                    "filename": MAP_NAME,
                    "log_tokens": [log],
                }
            ],
            "sensor": [{"token": token_of("sensor", CHANNEL), "channel": CHANNEL, "modality": "lidar"}],
            "calibrated_sensor": list(self._mounts.values()),
            "category": _named("category", self.objects.categories),
            "attribute": _named("attribute", self.objects.attributes),
            "visibility": [
                {"token": str(number), "level": level, "description": ""}
                for number, level in enumerate(levels, 1)
            ],
        }


def _named(table: str, names: Iterable[str]) -> list[Record]:
    return [{"token": token_of(table, name), "name": name, "description": ""} for name in sorted(names)]


def _posed(a_SE3_b: Float64) -> Record:
    x, y, z, w = quaternion_xyzw(a_SE3_b).tolist()
    return {"rotation": [w, x, y, z], "translation": a_SE3_b[:3, 3].tolist()}


def _write_cloud(file: Path, cloud: Cloud) -> None:
    """x, y, z, intensity times 255, ring: float32 each."""
    points = np.empty((len(cloud), 5), "<f4")
    for place, name in enumerate(("x", "y", "z", "intensity", "ring")):
        points[:, place] = cloud[name]
    points[:, 3] *= np.float32(STRONGEST)
    file.write_bytes(points.tobytes())


def _write_map(file: Path) -> None:
    """An empty map of one pixel, without which the development kit does not start."""
    from PIL import Image

    file.parent.mkdir()
    Image.new("L", (1, 1)).save(file)
