"""Messages through Artery step by step: what it is told, what comes back, and what goes wrong."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.artery.given_drive import ArteryAgain
from advpipe.pipeline.artery.given_medium import LONGEST_WAIT_NS
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.v2x.radio.medium import Step
from advpipe.pipeline.v2x.radio.stations import Outcome, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio

START_NS = 1_700_000_000_000_000_000
PLACES_M = {5: (0.0, 0.0, 1.5), 7: (30.0, 40.0, 1.5), 9: (0.0, 500.0, 1.5)}
RADIO = Radio(building_loss="none", vehicle_loss="none")


def stations(*ids: int) -> Stations:
    return Stations(np.array(ids), np.array([PLACES_M[number] for number in ids]))


def sent(*messages: tuple[int, int, int]) -> Transmissions:
    """Number, sender, and nanoseconds after the start of each."""
    numbers, senders, times_ns = np.array(messages, np.int64).reshape(-1, 3).T
    return Transmissions(
        *(numbers, numbers.astype(np.uint64), senders, times_ns + START_NS, np.full(len(numbers), 100)),
        np.full(len(numbers), 23.0),
        tuple(b"message" for _ in messages),
    )


def steps(
    messages: Sequence[Sequence[tuple[int, int, int]]], ids: Sequence[Sequence[int]] = ((5, 7, 9),) * 9
) -> list[Step]:
    """The results of steps of 0.1 s with these messages and stations."""
    with ArteryAgain("drive", RADIO, 1, 5.0).open() as medium:
        return [
            medium.advance(START_NS + (index + 1) * 100_000_000, stations(*ids[index]), sent(*step))
            for index, step in enumerate(messages)
        ]


def test_artery_decides_who_receives_when(artery: Callable[..., Path]) -> None:
    artery()
    first, _ = steps([[(0, 5, 10_000_000), (1, 9, 50_000_000)], []])
    assert first.outcomes.messages.tolist() == [0, 1]
    assert first.outcomes.outcome.tolist() == [
        [Outcome.OWN, Outcome.RECEIVED, Outcome.WEAK],
        [Outcome.WEAK, Outcome.WEAK, Outcome.OWN],
    ]
    (reception,) = first.outcomes.receptions()
    assert (reception.receiver, reception.arrival_ns) == (7, START_NS + 10_400_000)
    assert reception.power_dbm == pytest.approx(23 - 20 * np.log10(50) - 48)
    (load,) = first.loads
    assert (load.stations.tolist(), load.busy_ratio.tolist()) == ([5, 7, 9], [0.125] * 3)


def test_the_load_of_a_tenth_of_a_second_comes_once(artery: Callable[..., Path]) -> None:
    artery()
    with ArteryAgain("drive", RADIO, 1, 5.0).open() as medium:
        found = [
            [
                (load.end_ns - START_NS) // 1_000_000
                for load in medium.advance(START_NS + end_ms * 1_000_000, stations(5, 7), sent(message)).loads
            ]
            for end_ms, message in ((50, (0, 5, 0)), (100, (1, 5, 50_000_000)), (400, (2, 5, 100_000_000)))
        ]
    assert found == [[], [100], [200, 300, 400]]


def test_a_message_on_the_air_at_the_end_of_a_step_comes_with_the_next(artery: Callable[..., Path]) -> None:
    artery()
    first, second = steps([[(0, 5, 99_590_000)], []])  # ends 10 us before the step does
    assert not len(first.outcomes.messages)
    assert second.outcomes.messages.tolist() == [0]
    assert second.outcomes.receptions()[0].arrival_ns == START_NS + 100_000_000


def test_what_waits_in_the_radio_of_a_station_that_leaves_is_dropped(artery: Callable[..., Path]) -> None:
    artery("--fault", "busy=1")
    first, second, third = steps(
        [[(0, 5, 10_000_000), (1, 7, 20_000_000)], [(2, 7, 120_000_000)], []], [(5, 7), (7, 9), (7, 9)]
    )
    assert not len(first.outcomes.messages)
    assert not len(first.outcomes.dropped)
    assert second.outcomes.dropped.tolist() == [0]  # 7, which stays, may still send 1
    assert second.outcomes.messages.tolist() == [2]
    assert not len(third.outcomes.dropped)


def test_what_a_station_has_sent_before_it_leaves_arrives(artery: Callable[..., Path]) -> None:
    artery()
    first, second = steps([[(0, 5, 99_990_000)], [(1, 7, 120_000_000)]], [(5, 7), (7, 9)])
    assert not len(first.outcomes.messages)
    assert second.outcomes.messages.tolist() == [0, 1]
    assert second.outcomes.outcome[1].tolist() == [Outcome.OWN, Outcome.WEAK]
    assert not len(second.outcomes.dropped)


def test_what_waits_too_long_is_dropped(artery: Callable[..., Path]) -> None:
    artery("--fault", "busy=1")
    dropped = []
    with ArteryAgain("drive", RADIO, 1, 5.0).open() as medium:
        messages = sent((0, 5, 0))
        for until_ns in (100_000_000, LONGEST_WAIT_NS, LONGEST_WAIT_NS + 1, LONGEST_WAIT_NS + 2):
            outcomes = medium.advance(START_NS + until_ns, stations(5, 7), messages).outcomes
            assert not len(outcomes.messages)
            dropped.append(outcomes.dropped.tolist())
            messages = sent()
    assert dropped == [[], [], [0], []]


def test_the_seed_of_the_recording_decides_arterys_draws(artery: Callable[..., Path]) -> None:
    """Without the line, the draws would be those of OMNeT++'s default seed in every drive."""
    ini = artery().with_name("omnetpp.ini")
    found = []
    for seed in (1, 1, 2):
        with ArteryAgain("drive", RADIO, seed, 5.0).open():
            (line,) = re.findall(r"^seed-0-mt = \d+$", ini.read_text(encoding="utf-8"), re.MULTILINE)
            found.append(line)
    assert found[0] == found[1] != found[2]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("start=0", "Artery ended: .*libINET.so"),
        ("old=0", "Artery's module is too old to attack a drive; build it anew"),
        ("crash=2", "Artery ended: signal 11"),
        ("error=2", r"Artery ended: exit code 1: Error: Signal power is negative -- in module \(Radio\)"),
        ("drift=2", "Artery is at 105000000 ns when the drive is at 100000000 ns"),
        ("garbage=2", "Artery's module sent a record of 5 bytes that advpipe cannot read; build it anew"),
        (
            "hang=2",
            "Artery does not finish a step of the simulation within 5 s; record the drive with a larger",
        ),
        ("no-hello=0", "Artery does not start within 5 s"),
    ],
)
def test_a_failure_is_one_line_and_leaves_no_process(
    artery: Callable[..., Path], fault: str, words: str
) -> None:
    pid = artery("--fault", fault)
    with pytest.raises(AdvpipeError, match=words) as error:
        steps([[], [], []])
    assert "\n" not in str(error.value)
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def test_another_version_of_the_module_is_refused(artery: Callable[..., Path]) -> None:
    artery("--protocol", "2")
    with pytest.raises(AdvpipeError, match="another version of advpipe's protocol; build it anew"):
        steps([[]])


def test_a_caller_that_fails_leaves_no_process(artery: Callable[..., Path]) -> None:
    pid = artery()
    with pytest.raises(KeyboardInterrupt), ArteryAgain("drive", RADIO, 1, 5.0).open():
        raise KeyboardInterrupt
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def test_a_missing_program_and_a_radio_that_artery_lacks_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ADVPIPE_ARTERY_BIN", str(tmp_path / "none"))
    with pytest.raises(UsageError, match="ADVPIPE_ARTERY_BIN: there is no file"):
        ArteryAgain("drive", RADIO, 1, 5.0)
    with pytest.raises(UsageError, match=r"drive was recorded with v2x\.radio\.interference: false, which"):
        ArteryAgain("drive", RADIO.model_copy(update={"interference": False}), 1, 5.0)
