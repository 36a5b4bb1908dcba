"""Bags without V2X to send again; whole drives: tests/stages/simulate."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.message_bounds import LATEST_NS
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.messages.v2x import stations_message
from advpipe.pipeline.replay.v2x_drive import LONGEST_STEP_NS, V2xDrive


def test_a_bag_without_v2x_is_refused(tmp_path: Path, record: Callable[..., Path]) -> None:
    with pytest.raises(AdvpipeError, match=r"bag has no /.*, so there is no V2X to replay"):
        V2xDrive(BagReader(record(tmp_path / "bag", frames=1)))


@pytest.mark.parametrize("info", ["", "{}", "[1]", '{"v2x": {"penetration": 7}}'])
def test_a_bag_with_an_invalid_scenario_is_refused(tmp_path: Path, info: str) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        writer.write(SCENARIO_INFO, string(info), 5)
        writer.write_cdr(*stations_message(5, ()))
    with pytest.raises(AdvpipeError, match="/scenario/info does not hold a scenario of this version"):
        V2xDrive(BagReader(tmp_path / "bag"))


def test_a_step_that_lasts_too_long_is_refused(tmp_path: Path) -> None:
    bag = _stations_at(tmp_path / "bag", 5, 5 + LONGEST_STEP_NS, 6 + 3 * LONGEST_STEP_NS)
    steps = V2xDrive(BagReader(bag)).steps()
    assert next(steps).end_ns == 5 + LONGEST_STEP_NS
    with pytest.raises(AdvpipeError, match=r"at 30000000006 ns comes 20.0 s after .* over 10 s"):
        next(steps)


def test_a_drive_after_the_last_ros_time_stamp_is_refused(tmp_path: Path) -> None:
    """What is sent again could not be stamped."""
    drive = V2xDrive(BagReader(_stations_at(tmp_path / "bag", LATEST_NS, LATEST_NS + 1)))
    with pytest.raises(AdvpipeError, match=r"/v2x/stations at \d+ ns is after January 2038"):
        list(drive.steps())


def _stations_at(path: Path, *times_ns: int) -> Path:
    """A drive in which no vehicle has a radio."""
    info = {
        "v2x": {},
        "map": {"origin": {"latitude_deg": 0.0, "longitude_deg": 0.0}},
        "simulation": {"seed": 1},
        "vehicles": {},
    }
    with BagWriter(path, provenance={}) as writer:
        writer.write(SCENARIO_INFO, string(json.dumps(info)), times_ns[0])
        for time_ns in times_ns:
            writer.write_cdr(*stations_message(time_ns, ()))
    return path
