"""Recording beside the relay."""

import threading
from pathlib import Path

import pytest
from relay_parts import recording

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.relay import recorder as recording_module
from advpipe.pipeline.campaigns.relay.recorder import TASK_BYTES
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import clock
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import serialise


def test_a_disk_that_is_too_slow_costs_no_time_and_bounded_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = threading.Event()
    cdr = serialise(clock(5), CLOCK.type)
    monkeypatch.setattr(recording_module, "MOST_BYTES", 100 * (len(cdr) + TASK_BYTES) + TASK_BYTES)
    with recording(tmp_path / "bag") as recorder:
        recorder.call(lambda: assert_waited(gate))
        for number in range(150):
            recorder.record(CLOCK, cdr, number)
        gate.set()
    assert recorder.lost == 50  # the task that waits counts, too
    assert BagReader(tmp_path / "bag").topics[CLOCK.name].count == 100


def assert_waited(gate: threading.Event) -> None:
    assert gate.wait(20)


def test_an_error_comes_back(tmp_path: Path) -> None:
    def fail() -> None:
        raise AdvpipeError("the disk is full")

    with pytest.raises(AdvpipeError, match="the disk is full"), recording(tmp_path / "bag") as recorder:
        recorder.call(fail)
    assert not (tmp_path / "bag").exists()
