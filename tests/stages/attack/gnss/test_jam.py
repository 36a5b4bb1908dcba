from __future__ import annotations

from advpipe.stages.attack.gnss.jam import Jam


def test_no_fix(follow):
    assert follow(Jam(), [[0, 0, 0], [1, 0, 0]]) == [None, None]
