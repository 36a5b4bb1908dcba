from __future__ import annotations

import numpy as np

from advpipe.stages.evaluate.localisation.plot import draw_localisation, spans
from advpipe.stages.evaluate.localisation.track import LocalisationTrack


def track(off_m: np.ndarray) -> LocalisationTrack:
    """100 m along x in 10 s, with estimates and fixes that far to the left."""
    count = len(off_m)
    true_m = np.stack([np.linspace(0, 100, count), np.zeros(count), np.zeros(count)], axis=1)
    ahead, left = np.tile([1.0, 0, 0], (count, 1)), np.array([0.0, 1, 0])
    times_ns = np.linspace(0, 10e9, count).astype(np.int64)
    estimate_m = true_m + off_m[:, None] * left
    return LocalisationTrack(times_ns, true_m, ahead, estimate_m.copy(), estimate_m, np.ones(count))


def test_the_second_map_shows_the_largest_error():
    """20 m at x = 50 m: from 16 m below the middle to 16 m above it."""
    off_m = np.zeros(101)
    off_m[40:61] = 20 - np.abs(np.arange(-10, 11)) / 10
    figure = draw_localisation(track(np.zeros(101)), track(off_m), off_m > 0)
    whole, near, error, innovation = figure.axes
    assert near.get_xlim() == (50 - 32, 50 + 32)
    assert near.get_ylim() == (10 - 16, 10 + 16)
    assert [text.get_text() for text in near.texts] == ["20.0 m"]
    assert whole.get_title(loc="left") == "the whole drive"
    figure.canvas.draw()
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts[:4] == ["true", "estimated", "reported", "reported, false"]
    assert "attacked fixes" in texts
    assert error.get_xlim() == innovation.get_xlim() == (0, 10)


def test_runs_of_attacked_steps():
    assert list(spans(np.array([0, 1, 1, 0, 0, 1, 0], dtype=bool))) == [(1, 2), (5, 5)]


def test_steps_between_two_fixes_do_not_part_them():
    """A fix in every other step."""
    attacked = np.zeros(20, dtype=bool)
    attacked[[2, 4, 6, 8, 14, 16, 18]] = True
    assert list(spans(attacked)) == [(2, 8), (14, 18)]


def test_none():
    assert list(spans(np.zeros(5, dtype=bool))) == []
