from __future__ import annotations

from advpipe.stages.attack.gnss.freeze import Freeze


def test_the_place_at_the_begin_of_the_span(follow):
    spoofed = follow(Freeze(), [[0, 0, 0], [1, 0, 0], [2, 0, 1], [3, 0, 2]], first=1)
    assert [place.tolist() for place in spoofed] == [[1, 0, 0]] * 3
