"""A line where a bag's clouds differ from those that a detector expects, with the option to use."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.lidar_mount import base_link_SE3_lidar
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.expected_input import ExpectedInput, expected_input_of
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.ground_plane import HEIGHTS_M, fit_ground
from advpipe.pipeline.messages.cloud import StampedCloud, xyz

TOLERATED_M, TOLERATED_DEG = 0.15, 1.0
"""The ground in a cloud may contradict the stated mount by this much in height and tilt."""

FULL_SCALES = (255.0, 65535.0)
"""The highest intensities of sensors that give whole numbers."""

_notice_once = cache(notice)
"""A sweep attacks and evaluates one bag many times."""


def notice_unexpected_input(
    reader: BagReader, topic: str, name: str, detector: ObjectDetector, adaptation: Adaptation
) -> None:
    """Prints how the first cloud of a topic differs from what a detector expects, and what to do.

    name: the detector's, as the user has it. Nothing is printed for a detector that declares nothing, and
    for what the adaptation takes care of.
    """
    expected = expected_input_of(detector)
    first = next(iter(reader.raw_messages([topic])), None)
    if expected is None or first is None:
        return
    for difference in input_differences(reader, reader.cloud(first), expected, adaptation):
        _notice_once(f"note: {reader.path}: {difference.format(detector=Path(name).name)}")


def input_differences(
    reader: BagReader, first: StampedCloud, expected: ExpectedInput, adaptation: Adaptation
) -> Iterator[str]:
    """Each difference of the first cloud as a sentence about the bag, with the option to use; `{detector}`
    stands for the detector's name."""
    if adaptation.level:
        fit = fit_ground(xyz(first.cloud))
        if isinstance(fit, str):
            yield f"{option_name('level', True)} does not level the first cloud: {fit}"
    elif stance := lidar_stance(reader, first):
        taken_m = expected.lidar_height_m if adaptation.lidar_height_m is None else adaptation.lidar_height_m
        if abs(stance.height_m - taken_m) > expected.tolerated_m:
            what = f"its LiDAR is {stance.height_m:.2f} m above the ground"
            if stance.stated_height_m is not None:
                what += f" of the first cloud (its mount says {stance.stated_height_m:.2f} m)"
            whose = "{detector} expects" if adaptation.lidar_height_m is None else "the option says"
            given = option_name("lidar_height_m", round(stance.height_m, 2))
            yield f"{what}, {whose} {taken_m:.2f} m; give {given} or {option_name('level', True)}"
        if stance.tilt_rad > expected.tolerated_rad:
            tilt_deg = math.degrees(stance.tilt_rad)
            yield (
                f"its LiDAR is tilted by {tilt_deg:.1f}°, {{detector}} expects level ground; "
                f"give {option_name('level', True)}"
            )
    brightest = float(np.nanmax(first.cloud["intensity"], initial=0.0))
    if brightest * adaptation.scale_intensity > 1.01 * expected.max_intensity:
        full = next((scale for scale in FULL_SCALES if brightest <= scale), brightest)
        option = option_name("scale_intensity", float(f"{expected.max_intensity / full:.6g}"))
        whose = f"{{detector}} expects up to {expected.max_intensity:g}"
        yield f"its intensities go up to {brightest:g}, {whose}; give {option}"


@dataclass(frozen=True)
class LidarStance:
    """How a LiDAR stands above the ground. stated_height_m: by the mount, where the ground contradicts it."""

    height_m: float
    tilt_rad: float
    stated_height_m: float | None = None


def lidar_stance(reader: BagReader, first: StampedCloud) -> LidarStance | None:
    """A LiDAR's height and tilt: by its mount, unless the ground in the first cloud contradicts it by more
    than a detector tolerates; None where neither is known."""
    pose = base_link_SE3_lidar(reader, first.frame_id)
    plane = fit_ground(xyz(first.cloud))
    seen = None if isinstance(plane, str) else LidarStance(plane.height_m, plane.tilt_rad)
    if pose is None or not HEIGHTS_M[0] < pose[2, 3] < HEIGHTS_M[1]:
        return seen
    stated = LidarStance(float(pose[2, 3]), float(np.arccos(np.clip(pose[2, 2], -1.0, 1.0))))
    if seen is None:
        return stated
    if abs(seen.height_m - stated.height_m) > TOLERATED_M:
        return replace(seen, stated_height_m=stated.height_m)
    is_tilted_otherwise = math.degrees(abs(seen.tilt_rad - stated.tilt_rad)) > TOLERATED_DEG
    return replace(stated, tilt_rad=seen.tilt_rad) if is_tilted_otherwise else stated
