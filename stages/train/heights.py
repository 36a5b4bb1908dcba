"""How high the LiDARs of the training drives are, for the checkpoint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.detector.expected_input import HEIGHT_KEY
from advpipe.pipeline.detector.input_notice import TOLERATED_M, lidar_stance


def training_height(bags: Iterable[Path]) -> Mapping[str, str]:
    """The provenance of the LiDARs' mean height; empty where a bag does not tell it.

    Prints a note where the heights differ by more than a detector tolerates.
    """
    heights_m = [_height_m(bag) for bag in bags]
    known_m = [height_m for height_m in heights_m if height_m is not None]
    if not known_m or len(known_m) < len(heights_m):
        return {}
    mean_m = sum(known_m) / len(known_m)
    if max(known_m) - min(known_m) > 2 * TOLERATED_M:
        notice(
            f"note: the LiDARs are {min(known_m):.2f} to {max(known_m):.2f} m above the ground; the "
            f"checkpoint expects their mean, {mean_m:.2f} m"
        )
    return {HEIGHT_KEY: f"{mean_m:.2f}"}


def _height_m(bag: Path) -> float | None:
    reader = BagReader(bag)
    first = reader.cloud(next(iter(reader.raw_messages([find_lidar_topic(reader)]))))
    stance = lidar_stance(reader, first)
    return None if stance is None else stance.height_m
