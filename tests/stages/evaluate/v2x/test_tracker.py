from __future__ import annotations

from advpipe.stages.evaluate.v2x.tracker import LONGEST_GAP_NS, PseudonymTrack, Sighting, linked

S = 1_000_000_000


def track(pseudonym: int, first: tuple[float, float], last: tuple[float, float], y_m: float = 0.0):
    """From one (time in s, x in m) to another, at 10 m/s along x."""
    ends = [Sighting(round(t_s * S), x_m, y_m, 0.0, 10.0) for t_s, x_m in (first, last)]
    return PseudonymTrack(pseudonym, *ends)


def test_the_nearest_prediction_is_taken_and_only_once() -> None:
    old = [track(1, (0, 0), (5, 50)), track(2, (0, 0), (5, 50), y_m=4)]
    new = [track(3, (6, 60), (9, 90), y_m=3.5), track(4, (6, 60), (9, 90), y_m=1)]
    assert linked(old + new) == {3: 2, 4: 1}


def test_a_station_that_still_sends_is_no_predecessor() -> None:
    assert linked([track(1, (0, 0), (7, 70)), track(2, (6, 60), (9, 90))]) == {}


def test_too_far_or_too_late_is_a_new_station() -> None:
    assert linked([track(1, (0, 0), (5, 50)), track(2, (6, 67), (9, 90))]) == {}
    late_s = 5 + LONGEST_GAP_NS / S + 1
    assert linked([track(1, (0, 0), (5, 50)), track(2, (late_s, 10 * late_s), (99, 990))]) == {}


def test_a_long_silence_widens_the_search_and_confuses_the_tracker() -> None:
    old = [track(1, (0, 0), (5, 50)), track(2, (0, 0), (5, 50), y_m=10)]
    new = [track(3, (10, 100), (12, 120), y_m=9), track(4, (10.5, 105), (12, 120), y_m=11)]
    assert linked([*old, *new]) == {3: 2, 4: 1}
