"""Recording beside the relay."""

import threading
from pathlib import Path

import pytest
from relay_parts import recording

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.relay.recorder import MOST_TASKS
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import clock
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import serialise


def test_a_disk_that_is_too_slow_costs_no_time_and_bounded_memory(tmp_path: Path) -> None:
    gate = threading.Event()
    cdr = serialise(clock(5), CLOCK.type)
    with recording(tmp_path / "bag") as recorder:
        recorder.call(lambda: assert_waited(gate))
        for number in range(MOST_TASKS + 50):
            recorder.record(CLOCK, cdr, number)
        gate.set()
    assert 50 <= recorder.lost <= 51  # the one that waits may be in the queue still
    assert BagReader(tmp_path / "bag").topics[CLOCK.name].count == MOST_TASKS + 50 - recorder.lost


def assert_waited(gate: threading.Event) -> None:
    assert gate.wait(20)


def test_an_error_comes_back(tmp_path: Path) -> None:
    def fail() -> None:
        raise AdvpipeError("the disk is full")

    with pytest.raises(AdvpipeError, match="the disk is full"), recording(tmp_path / "bag") as recorder:
        recorder.call(fail)
    assert not (tmp_path / "bag").exists()
