from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.replay import GnssReplay

PATH = [[float(k), 0, 0] for k in range(10)]


def test_the_fix_of_three_tenths_of_a_second_ago(follow):
    spoofed = follow(GnssReplay(delay_s=0.3), PATH, first=5)
    assert [place[0] for place in spoofed] == [2, 3, 4, 5, 6]


def test_between_two_fixes_the_older_one(follow):
    assert follow(GnssReplay(delay_s=0.25), PATH, first=9)[0][0] == 6


def test_nothing_is_older_than_the_first(follow):
    assert [place[0] for place in follow(GnssReplay(delay_s=0.8), PATH)] == [0, 0, 0, 0, 0, 0, 0, 0, 0, 1]


def test_refuses():
    with pytest.raises(AdvpipeError, match="gnss-replay: delay_s is -1"):
        GnssReplay(delay_s=-1)
