"""The time that chosen clouds span."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window, window_of
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.messages import build, topics

START_NS, STEP_NS = 1_700_000_000_000_000_000, 100_000_000


@pytest.mark.parametrize(
    ("frames", "first", "end"),
    [("2:5", 2, 5), ("3", 3, 4), ("1:7:2", 1, 6), ("4:", 4, 7), ("0:", 0, 7), ("::3", 0, 7)],
)
def test_from_the_first_cloud_to_one_period_after_the_last(
    tmp_path: Path, record, frames: str, first: int, end: int
) -> None:
    """Of 7 clouds; 1:7:2 chooses 1, 3 and 5, and what lies between them in time is inside."""
    reader = BagReader(record(tmp_path / "bag", frames=7))
    found = window_of(reader, FrameSlice.parse(frames))
    expected = WHOLE_DRIVE if frames == "0:" else Window(START_NS + first * STEP_NS, START_NS + end * STEP_NS)
    assert found == expected


def test_a_single_cloud_lasts_a_tenth_of_a_second(tmp_path: Path, record) -> None:
    reader = BagReader(record(tmp_path / "bag", frames=1))
    assert window_of(reader, FrameSlice.parse("0")) == Window(START_NS, START_NS + STEP_NS)


def test_its_begin_is_inside_and_its_end_is_not() -> None:
    window = Window(10, 20)
    assert window.holds([9, 10, 19, 20]).tolist() == [False, True, True, False]
    assert window.is_before_end([9, 10, 19, 20]).tolist() == [True, True, True, False]
    assert window.last_ns == 19
    assert WHOLE_DRIVE.holds([0, 2**62]).all()
    assert WHOLE_DRIVE.last_ns is None


def test_a_bag_without_clouds_has_no_frames_to_choose(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write(topics.CLOCK, build.clock(START_NS), START_NS)
    reader = BagReader(tmp_path / "bag")
    assert window_of(reader, FrameSlice()) == WHOLE_DRIVE
    with pytest.raises(
        AdvpipeError, match="holds no LiDAR clouds, so the frames 2:5:1 select no time span"
    ) as error:
        window_of(reader, FrameSlice(2, 5))
    assert "\n" not in str(error.value)
