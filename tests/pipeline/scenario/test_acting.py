"""When an attack acts: by the clock of the bag, and randomly by the seed."""

from __future__ import annotations

import pytest

from advpipe.pipeline.scenario.acting import acting_on_fixes, acting_on_messages
from advpipe.pipeline.scenario.attacks import NS_PER_S, attack_spec

START_NS = 1_700_000_000 * NS_PER_S
TIMES_NS = range(START_NS, START_NS + 2 * NS_PER_S, NS_PER_S // 500)


def test_schedules_count_from_the_start_of_the_bag() -> None:
    spec = attack_spec({"type": "cam-dos", "schedule": {"from_s": 0.5, "to_s": 1.5}})
    acts = acting_on_messages(spec, START_NS, 1)
    assert [acts(START_NS + tenth * NS_PER_S // 10) for tenth in (4, 5, 14, 15)] == [False, True, True, False]


def test_the_random_draw_of_a_message_is_repeatable() -> None:
    spec = attack_spec({"type": "cam-dos", "schedule": {"kind": "random", "probability": 0.3}})
    first, again = (acting_on_messages(spec, START_NS, 1) for _ in range(2))
    answers = [first(time_ns) for time_ns in TIMES_NS]
    assert [again(time_ns) for time_ns in reversed(TIMES_NS)] == answers[::-1]
    assert sum(answers) == pytest.approx(300, abs=60)
    assert [acting_on_messages(spec, START_NS, 2)(time_ns) for time_ns in TIMES_NS] != answers


def test_the_random_draws_of_fixes_follow_their_order() -> None:
    spec = attack_spec({"type": "gnss-bias", "schedule": {"kind": "random", "probability": 0.3}})
    answers = [
        [acts(time_ns) for time_ns in TIMES_NS]
        for acts in (acting_on_fixes(spec, victim, START_NS, 1) for victim in ("ego", "ego", "other"))
    ]
    assert answers[0] == answers[1] != answers[2]
    assert sum(answers[0]) == pytest.approx(300, abs=60)
