"""Cumulative sums by numbers that a person can check."""

from __future__ import annotations

import math
from importlib.resources import files

import pytest

from advpipe.stages.investigate.calibration import FILE, Calibration, CueCalibration, shipped_calibration
from advpipe.stages.investigate.cue import GNSS, CueReading, station
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.suspicion import FORGET_S, CumulativeSuspicion

SIMPLE = Calibration({"a": CueCalibration(2.0, 1.0), "b": CueCalibration(1.0, 2.0)}, -2.999, half_life_s=1e9)


def reading(time_s: float, value: float, who: int = 7) -> CueReading:
    return CueReading(station(who), round(time_s * 1e9), value, "words")


def test_a_reading_adds_the_logarithm_of_its_ratio_within_bounds() -> None:
    assert SIMPLE.step("a", 4.0) == pytest.approx(math.log(2))
    assert SIMPLE.step("a", 39.0) == 1.5
    assert SIMPLE.step("a", 200.0) == 3.0  # a hundred times the limit
    assert SIMPLE.step("a", 0.0) == SIMPLE.step("a", 0.1) == -0.25


def test_the_alarm_comes_when_the_evidence_outweighs_the_prior() -> None:
    """Three nats speak against anybody's lying: two readings of cue a add 1.5 each."""
    suspicion = CumulativeSuspicion(SIMPLE)
    suspicion.add("a", reading(1.0, 0.0))
    suspicion.add("a", reading(2.0, 30.0))
    assert suspicion.named() == ([], [])
    suspicion.add("a", reading(2.5, 30.0))
    ((who, record),), _ = suspicion.named()
    episode = record.episodes[0]
    assert who == station(7)
    assert (episode.start_ns, episode.alarm_ns) == (2_000_000_000, 2_500_000_000)
    assert episode.probability == pytest.approx(0.5, abs=1e-3)
    assert episode.cue_share == {"a": 1.0}


def test_of_many_cues_none_of_which_says_much_the_first_says_when_it_began() -> None:
    names = [f"cue {number}" for number in range(8)]
    calibration = Calibration({name: CueCalibration(1.0, 1.0) for name in names}, -10.0)
    suspicion = CumulativeSuspicion(calibration)
    for number, name in enumerate(names):
        suspicion.add(name, reading(1.0 + number / 100, 100.0))
    ((_, record),), _ = suspicion.named()
    assert record.episodes[0].start_ns == 1_000_000_000


def test_evidence_fades_and_an_episode_ends() -> None:
    calibration = Calibration(SIMPLE.cues, -2.0, half_life_s=1.0, ceiling=3.0)
    suspicion = CumulativeSuspicion(calibration)
    for time_s in (1.0, 1.1, 1.2):
        suspicion.add("b", reading(time_s, 100.0))
    record = suspicion.records[station(7)]
    assert record.is_lying
    suspicion.add("b", reading(11.2, 0.0))
    assert not record.is_lying
    assert record.episodes[0].end_ns == 1_200_000_000


def test_a_false_gnss_explains_what_depends_on_the_own_place() -> None:
    suspicion = CumulativeSuspicion(SIMPLE, relying={"b"})
    for time_s in (1.0, 1.1, 1.2):
        suspicion.add("b", reading(time_s, 100.0, who=7))
        suspicion.add("a", reading(time_s, 100.0, who=8))
    for time_s in (2.0, 2.1, 2.2):
        suspicion.add("a", CueReading(GNSS, round(time_s * 1e9), 100.0, "words"))
    suspicion.add("b", reading(2.3, 100.0, who=9))
    named, explained = suspicion.named()
    assert {who for who, _ in named} == {station(8), GNSS}
    assert explained == [station(7)]
    assert station(9) not in suspicion.records


def test_a_flood_of_stations_is_forgotten() -> None:
    suspicion = CumulativeSuspicion(SIMPLE)
    for number in range(20_000):
        suspicion.add("a", reading(number / 100, 0.0, who=number))
    assert suspicion.seen == 20_000
    assert len(suspicion.records) < 100 * 2 * FORGET_S


def test_the_shipped_calibration_knows_every_cue() -> None:
    shipped = shipped_calibration()
    assert shipped.cues.keys() == CUES.keys()
    assert Calibration.of_plain(shipped.to_plain()) == shipped
    assert shipped.without("free-space").cues["free-space"].weight == 0.0
    assert shipped.probability({}) < shipped.alarm_probability


def test_the_shipped_calibration_is_the_file_that_the_benchmark_writes() -> None:
    """Byte by byte, so that no number in it was set by hand since; and every limit has its least."""
    path = files("advpipe.stages.investigate").joinpath(FILE)
    shipped = shipped_calibration()
    assert path.read_text(encoding="utf-8") == shipped.text()
    assert shipped.drives
    assert all(one.limit > 0 and one.weight >= 0 and 1 <= one.sharpness <= 4 for one in shipped.cues.values())
