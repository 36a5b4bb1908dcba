"""Bags without V2X to send again, and footprints to the bit; whole drives: tests/stages/simulate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from advpipe.pipeline.bag.messages import string
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import SCENARIO_INFO
from advpipe.pipeline.bag.v2x import stations_message
from advpipe.pipeline.bag.v2x_drive import V2xDrive, footprints_of_text, footprints_text
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.errors import AdvpipeError


def test_a_bag_without_v2x(tmp_path: Path, record: Callable[..., Path]) -> None:
    with pytest.raises(AdvpipeError, match=r"bag has no /.*: no V2X to send again"):
        V2xDrive(BagReader(record(tmp_path / "bag", frames=1)))


@pytest.mark.parametrize("info", ["", "{}", "[1]", '{"v2x": {"penetration": 7}}'])
def test_a_scenario_that_is_none(tmp_path: Path, info: str) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        writer.write(SCENARIO_INFO, string(info), 5)
        writer.write_cdr(*stations_message(5, ()))
    with pytest.raises(AdvpipeError, match="/scenario/info holds no scenario of this version"):
        V2xDrive(BagReader(tmp_path / "bag"))


@pytest.mark.parametrize("count", [0, 1, 20])
def test_footprints_to_the_bit(count: int) -> None:
    rng = np.random.default_rng(1)
    footprints = [shapely.MultiPoint(rng.uniform(-500, 500, (4, 2))).convex_hull for _ in range(count)]
    found = footprints_of_text(footprints_text(footprints))
    assert len(found) == count
    for one, expected in zip(found, footprints, strict=True):
        assert (shapely.get_coordinates(one) == shapely.get_coordinates(expected)).all()
