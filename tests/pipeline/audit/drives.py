"""Data sets of one second a cloud, of a small rotating LiDAR, with an attack that adds points."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.provenance import attack_provenance, clean_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.labels.clouds import LabelledFrame, PointTables
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, StampedCloud, cloud_to_cdr
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics

RINGS, COLUMNS, CLOUDS, ADDED = 8, 60, 24, 12
EPOCH_NS, PERIOD_NS = 1_700_000_000_000_000_000, 1_000_000_000
POINTS = VehicleTopics("ego").lidar_points

Place = Callable[[Cloud, Cloud], tuple[Cloud, np.ndarray]]
"""Puts added points into a cloud; returns it, and where they are."""


def turn(draw: np.random.Generator) -> Cloud:
    """Every ray returns a point, column by column."""
    column, ring = (each.ravel() for each in np.mgrid[:COLUMNS, :RINGS])
    azimuth, elevation = np.pi - column * 2 * np.pi / COLUMNS, np.deg2rad(-15 + 2.0 * ring)
    range_m = draw.uniform(3, 30, len(column))
    cloud = np.zeros(len(column), POINT_DTYPE)
    flat = range_m * np.cos(elevation)
    cloud["x"], cloud["y"] = flat * np.cos(azimuth), flat * np.sin(azimuth)
    cloud["z"], cloud["ring"], cloud["intensity"] = range_m * np.sin(elevation), ring, draw.random(len(cloud))
    return cloud


def at_end(clean: Cloud, added: Cloud) -> tuple[Cloud, np.ndarray]:
    """As attacks did that gave themselves away."""
    return np.concatenate([clean, added]), np.arange(len(clean), len(clean) + len(added))


def write_data_set(folder: Path, seed: int, place: Place, bounds: dict[str, tuple[float, float]]) -> Path:
    """A drive whose rays lose a fifth of their points, and an attack that gives back twelve of them: nothing
    but their place in the array can tell."""
    draw = np.random.default_rng(seed)
    turns = [turn(draw) for _ in range(CLOUDS)]
    seen = [np.flatnonzero(draw.random(len(each)) > 0.2) for each in turns]
    clean = [each[own] for each, own in zip(turns, seen, strict=True)]
    _write(folder / "clean", clean_provenance("test", "simulation: {}\n", seed, "0" * 64), clean)
    attack = {"type": "add", "parameters": {}, "declared": {"family": "lidar", "bounds": bounds}}
    parent = BagReader(folder / "clean")
    record = attack_provenance(
        parent.path, parent.provenance, attack="add", recipe="", parameters={}, seed=1, frames="::"
    )
    bag = folder / "add"
    attacked, labels = [], []
    for each, own, kept in zip(turns, seen, clean, strict=True):
        back = np.sort(draw.choice(np.setdiff1d(np.arange(len(each)), own), ADDED, replace=False))
        cloud, places = place(kept, each[back])
        attacked.append(cloud)
        labels.append(PointLabels(np.full(ADDED, -1), np.full(ADDED, "added"), np.zeros(ADDED), places))
    _write(bag, {**record, "attacks": json.dumps([attack])}, attacked)
    with PointTables(bag) as tables:
        for frame, (kept, cloud, own) in enumerate(zip(clean, attacked, labels, strict=True)):
            stamped = StampedCloud(EPOCH_NS + frame * PERIOD_NS, "ego/lidar", kept)
            tables.add(LabelledFrame(POINTS.name, frame, "add", stamped, len(cloud)), own)
    return folder


def _write(path: Path, provenance: dict[str, str], clouds: list[Cloud]) -> None:
    with BagWriter(path, provenance=provenance) as bag:
        info = {"vehicles": {"ego": {}}, "sensors": {"lidars": {"lidar": {"vehicle": "ego"}}}}
        bag.write(SCENARIO_INFO, build.string(json.dumps(info)), EPOCH_NS)
        for frame, cloud in enumerate(clouds):
            stamp_ns = EPOCH_NS + frame * PERIOD_NS
            bag.write_cdr(POINTS, cloud_to_cdr(cloud, stamp_ns, "ego/lidar"), stamp_ns)
