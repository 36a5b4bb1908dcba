"""Bags without V2X to send again; whole drives: tests/stages/simulate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.messages.v2x import stations_message
from advpipe.pipeline.replay.v2x_drive import V2xDrive


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
