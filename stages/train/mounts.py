"""How the LiDARs of training drives are mounted: all clouds are seen from one height in training."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import repeat
from pathlib import Path

from advpipe.pipeline.bag.frames import count_frames, find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.expected_input import HEIGHT_KEY, ExpectedInput
from advpipe.pipeline.detector.input_notice import lidar_stance
from advpipe.stages.train.frames import StoredMount


def drive_mount(bag: Path, expected: ExpectedInput | None) -> StoredMount:
    """How clouds of a bag are to be raised for a detector that expects its LiDAR at a height; they stay where
    their height is unknown, or the detector expects none."""
    reader = BagReader(bag)
    first = reader.cloud(next(iter(reader.raw_messages([find_lidar_topic(reader)]))))
    stance = lidar_stance(reader, first)
    raised_m = 0.0 if stance is None or expected is None else stance.height_m - expected.lidar_height_m
    return StoredMount(raised_m, int(first.cloud["ring"].max(initial=0)) + 1)


def mounts_of_frames(bags: Iterable[Path], expected: ExpectedInput | None) -> Iterator[StoredMount]:
    """The mount of every frame of the bags, in their order."""
    for bag in bags:
        if frames := count_frames(bag):
            yield from repeat(drive_mount(bag, expected), frames)


def expected_height(expected: ExpectedInput | None) -> Mapping[str, str]:
    """The provenance of the height from which training clouds are seen."""
    return {} if expected is None else {HEIGHT_KEY: f"{expected.lidar_height_m:.2f}"}
