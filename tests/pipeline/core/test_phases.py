"""How far a command is: planned and unplanned phases, items, and phases within items."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.phases import SLOW_S, UNPLANNED, Phase


def test_phases_take_their_shares() -> None:
    command = Phase("evaluating")
    command.plan({"reading": 10, "detecting": 60, "writing": 30})
    reading = command.part("reading")
    assert (reading.begin, reading.end) == (0.0, pytest.approx(0.1))
    command.leave(reading)
    detecting = command.part("detecting", total=3)
    assert (detecting.begin, detecting.end) == (pytest.approx(0.1), pytest.approx(0.7))
    detecting.advance()
    assert detecting.done == pytest.approx(0.3)
    inner = detecting.part("a try")  # of the second item
    assert inner.begin == pytest.approx(0.3)
    assert inner.end <= 0.5
    command.leave(detecting)
    assert command.part("writing").end == 1.0


def test_what_is_left_out_gives_its_share_to_the_rest() -> None:
    command = Phase("attacking")
    command.plan({"loading": 1, "messages": 5, "clouds": 3, "writing": 1})
    command.leave(command.part("loading"))
    clouds = command.part("clouds")
    assert clouds.end - clouds.begin == pytest.approx(0.9 * 3 / 4)


def test_an_unplanned_phase_takes_a_little_of_what_is_left() -> None:
    command = Phase("sweeping")
    command.plan({"cell": 1})
    extra = command.part("loading")
    assert extra.end == pytest.approx(UNPLANNED / (1 + UNPLANNED))
    command.leave(extra)
    assert command.part("cell").end == 1.0


def test_without_a_plan_it_never_ends_before_its_end_nor_goes_back() -> None:
    command, done = Phase("verifying"), [0.0]
    for _ in range(20):
        part = command.part("checking", total=4)
        for _ in range(6):  # more than announced
            part.advance()
            done.append(part.done)
        command.leave(part)
        done.append(command.done)
    assert done == sorted(done)
    assert 0.9 < done[-1] < 1.0


def test_a_phase_may_say_how_much_is_done() -> None:
    phase = Phase("unpacking", 0.5, 1.0)
    phase.reach(0.5)
    phase.reach(0.2)
    assert phase.done == 0.75
    phase.reach(7.0)
    assert phase.done == 1.0


def test_what_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([0.0, 0.0, 1.0, SLOW_S, SLOW_S])
    monkeypatch.setattr("advpipe.pipeline.core.phases.time.monotonic", lambda: next(now, 60.0))
    counted, silent = Phase("detecting", total=1200), Phase("loading")
    assert silent.text(is_last=True) == "loading"
    assert silent.text(is_last=True) == "loading, 3 s"
    assert counted.text(is_last=True) == "detecting: 0 of 1,200, 3 s"
    assert silent.text(is_last=False) == "loading"
    counted.advance()
    assert counted.text(is_last=True) == "detecting: 1 of 1,200"
