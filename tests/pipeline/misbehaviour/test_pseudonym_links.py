from __future__ import annotations

import math

from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.misbehaviour.pseudonym_links import LONGEST_GAP_S, PseudonymLinks

NS = 1_000_000_000


def claim(
    station_id: int, at_s: float, x_m: float, speed_mps: float = 10.0, length_m: float = 4.5, y_m: float = 0.0
) -> Claim:
    at_ns = round(at_s * NS)
    found = Claim(station_id, at_ns, at_ns, x_m, y_m, 0.0, speed_mps)
    return found._replace(length_m=length_m, width_m=1.8, station_type=5)


def ids(*claims: Claim) -> list[int]:
    return [one.station_id for one in PseudonymLinks().linked(claims)]


def test_a_new_id_at_the_predicted_place_continues_the_station() -> None:
    assert ids(claim(1, 0, 0), claim(2, 0.5, 5.2), claim(2, 0.6, 6), claim(3, 3.6, 41)) == [1, 1, 1, 1]


def test_another_place_size_or_time_is_another_station() -> None:
    assert ids(claim(1, 0, 0), claim(2, 0.5, 15)) == [1, 2]
    assert ids(claim(1, 0, 0), claim(2, 0.5, 5, length_m=5.0)) == [1, 2]
    late_s = LONGEST_GAP_S + 1
    assert ids(claim(1, 0, 0), claim(2, late_s, 10 * late_s)) == [1, 2]


def test_of_two_that_fit_the_nearest_is_continued_and_only_once() -> None:
    two = (claim(1, 0, 0), claim(2, 0, 0, y_m=3.0))
    assert ids(*two, claim(3, 0.5, 5, y_m=2.5), claim(4, 0.5, 5, y_m=0.5)) == [1, 2, 2, 1]


def test_an_id_that_goes_on_after_it_was_continued_is_the_same_station_still() -> None:
    assert ids(claim(1, 0, 0), claim(2, 0.5, 5), claim(1, 0.6, 6), claim(2, 0.7, 7)) == [1, 1, 1, 1]


def known(silence_s: float, *claims: Claim) -> list[bool]:
    """Whether each may be a station that was heard before; a first message 60 s before them."""
    far = claim(99, -60, 5000, length_m=12.0)
    return [one.may_be_known for one in PseudonymLinks(silence_s).linked([far, *claims])][1:]


def test_who_turns_while_it_is_silent_may_be_known_but_is_not_linked() -> None:
    after_turn = claim(2, 2.5, 12, y_m=10)._replace(yaw_rad=math.pi / 2)
    assert ids(claim(1, 0, 0), after_turn) == [1, 2]
    assert known(3.0, claim(1, 0, 0), after_turn) == [False, True]
    assert known(0.0, claim(1, 0, 0), after_turn) == [False, False]  # nobody falls silent there


def test_a_silent_station_explains_one_new_id_of_its_size_within_its_reach() -> None:
    beside = claim(2, 2.5, 0, y_m=20)
    assert known(3.0, claim(1, 0, 0), beside, beside._replace(station_id=3)) == [False, True, False]
    assert known(3.0, claim(1, 0, 0), beside._replace(length_m=5.0)) == [False, False]
    assert known(3.0, claim(1, 0, 0), beside._replace(y_m=60.0)) == [False, False]
    late = claim(2, 9.0, 0, y_m=20)
    assert known(3.0, claim(1, 0, 0), late) == [False, False]
    sending = claim(1, 2.0, 20)
    assert known(3.0, claim(1, 0, 0), sending, beside) == [False, False, False]


def test_at_first_any_id_may_be_that_of_a_station_that_was_silent_before() -> None:
    first, second, third = claim(1, 0, 0), claim(2, 4, 500), claim(3, 6, 900)
    found = PseudonymLinks(3.0).linked([first, second, third])
    assert [one.may_be_known for one in found] == [True, True, False]


def test_messages_without_a_place_stay_as_they_are() -> None:
    bad = Claim(-1, 5, 5)
    assert PseudonymLinks().linked([bad, claim(1, 0, 0), claim(2, 0.5, math.nan)])[0] is bad
