"""The shipped scenario: two vehicles near each other all the time, and what its attacks do to their poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.cooperative.pair import Alignment, find_pair, misalignment_m
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.simulate.run import simulate

PLAIN = [
    "v2x.enabled=false",
    "recording.markers=false",
    *(f"sensors.lidars.{name}.points_per_second=6400" for name in ("lidar", "lidar2")),
]
"""The same drive, and hardly any points."""


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("cooperative", PLAIN)


@pytest.fixture(scope="module")
def clean(scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate(scenario, tmp_path_factory.mktemp("cooperative") / "drive").bag


def off_m(clean: Path, bag: Path, from_s: float, to_s: float) -> np.ndarray:
    """How far a bag's poses misplace the other's sensor, at each stamp of a span."""
    reader, attacked = BagReader(clean), BagReader(bag)
    pair = find_pair(reader)
    true, reported = Alignment(reader, pair, true=True), Alignment(attacked, pair)
    stamps_ns = np.array(reader.log_times_ns(pair.own.odometry.name))
    elapsed_s = (stamps_ns - stamps_ns[0]) / 1e9
    inside = stamps_ns[(elapsed_s >= from_s) & (elapsed_s < to_s)]
    return np.array([misalignment_m(reported.at(int(at)), true.at(int(at))) for at in inside])


def test_they_see_each_others_surroundings_all_the_time(clean: Path, scenario) -> None:
    reader = BagReader(clean)
    true = Alignment(reader, find_pair(reader), true=True)
    stamps_ns = reader.log_times_ns(find_pair(reader).own.odometry.name)
    apart_m = [np.linalg.norm(true.at(int(at))[:3, 3]) for at in stamps_ns]
    assert len(apart_m) == scenario.simulation.frames
    assert min(apart_m) > 10  # two lengths of a car
    assert max(apart_m) < 50


def test_clean_poses_put_the_others_sensor_right(clean: Path) -> None:
    """Fixes err by centimetres, and half a degree of heading is 0.3 m at 36 m."""
    assert off_m(clean, clean, 3, 20).max() < 0.5


@pytest.mark.parametrize(
    ("name", "least_m", "most_m"),
    [
        ("rba", 0.5, np.sqrt(3**2 + 3**2 + 6**2) + 0.5),  # inside the box that the bias is drawn from
        ("paa", 49, 151),  # its distance in the plane
    ],
)
def test_attacks_misplace_it_by_what_they_draw(
    clean: Path, scenario, tmp_path: Path, name: str, least_m: float, most_m: float
) -> None:
    attack(clean, tmp_path / name, AttackRequest(scenario.attacks[name], scenario.simulation.seed))
    before_m, held_m = (off_m(clean, tmp_path / name, *span) for span in ((3, 6), (12, 18)))
    assert before_m.max() < 0.5
    assert least_m < np.median(held_m) < most_m


@pytest.mark.nightly  # test_cooperative.py has frames, and localisation/test_section.py their window
def test_a_report_of_some_frames_is_of_these_and_of_their_time(clean: Path, scenario, tmp_path: Path) -> None:
    """Two clouds a second and GPS false from 6 s on: frames 0 to 3 fuse nothing, 16 and 17 are fused."""
    attack(clean, tmp_path / "rba", AttackRequest(scenario.attacks["rba"], scenario.simulation.seed))
    localisation = []
    for chosen, frames in (("0:4", set()), ("16:18", {2})):
        out = tmp_path / chosen.replace(":", "-")
        report = evaluate(clean, [tmp_path / "rba"], out, Options(frames=FrameSlice.parse(chosen)))
        sections = {each.key: each for each in report.sections}
        assert set(sections) == {"localisation", "cooperative"}
        assert {record["frames"] for record in rows_of(sections["cooperative"])} == frames
        assert "attacks are of the window from the first of these" in report.formulas["frames"]
        assert sections["localisation"].notes[-1].startswith("All values of this part are of the window of")
        assert "All values of this part are of the window of" in (out / "report.html").read_text()
        localisation += rows_of(sections["localisation"])
    before, during = localisation
    assert (before["attacked"], before["ate_m"]) == (0, before["ate_clean_m"])
    assert during["attacked"] == during["fixes"] > 0
    assert during["ate_m"] > during["ate_clean_m"]
