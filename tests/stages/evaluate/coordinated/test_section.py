"""A drive whose GPS, messages and clouds are attacked in its second second, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.coordinated.attack_timeline import AttackTimeline
from advpipe.stages.evaluate.coordinated.section import coordinated_sections, together
from advpipe.stages.evaluate.report.section import SECTION, ReportSection
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=8", "sensors.lidars.lidar.points_per_second=8000")
SPAN = Schedule(from_s=1, to_s=2)
FAR = {"least_m": 80, "most_m": 80}
GPS = AttackSpec(type="gnss-relocate", victim="ego", parameters=FAR, schedule=SPAN)
JAM = AttackSpec(type="cam-sybil-congestion", victim="ego", schedule=SPAN)
HIDE = AttackSpec(
    type="detach", recipe="random", parameters={"ratio": 0.05}, frames="::5", victim="ego", schedule=SPAN
)


@pytest.fixture(scope="module")
def smoke(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("coordinated") / "smoke"
    settings = ["simulation.duration_s=3", "v2x.penetration=1", "recording.markers=false"]
    simulate(load_scenario("smoke", [*COARSE, *settings]), out)
    return out / "clean"


@pytest.fixture(scope="module")
def attacked_bag(smoke: Path) -> Path:
    out = smoke.parent / "three"
    attack(smoke, out, AttackRequest((JAM, HIDE, GPS), 7))
    return out


@pytest.fixture(scope="module")
def found(smoke: Path, attacked_bag: Path) -> ReportSection:
    (one,) = coordinated_sections(smoke, [attacked_bag], 0)
    return one


def test_all_attacks_on_one_vehicle_are_in_one_table(found: ReportSection, attacked_bag: Path) -> None:
    """Ten fixes and two of the six clouds that the bag holds: those of 1.0 and 1.5 s."""
    when, means = found.tables
    assert [line[:3] for line in when.lines] == [
        ("three", "ego", attack) for attack in ("gnss-relocate", "cam-sybil-congestion", "detach")
    ]
    sent = pq.read_table(attacked_bag / "v2x_labels.parquet").to_pylist()
    ghosts = [row for row in sent if row["attack"] == "cam-sybil-congestion"]
    assert [line[3] for line in when.lines] == ["10 fixes", f"{len(ghosts)} messages", "2 clouds"]
    assert [line[4:] for line in when.lines][::2] == [("1.0", "1.9"), ("1.0", "1.5")]
    assert found.lead.startswith("three: gnss-relocate, cam-sybil-congestion and detach attack ego together")
    for table in found.tables:
        assert all(len(line) == len(table.heads) for line in table.lines)
    assert [line[2].split(":")[0] for line in means.lines] == [
        "error of the position estimate [m]",
        "wrong LDM entries",
        "points changed per cloud",
    ]


def test_the_means_are_those_of_the_common_time(found: ReportSection, attacked_bag: Path) -> None:
    """Pulled towards a place 80 m away; up to six ghosts in its map; a twentieth of each cloud is gone."""
    (record,) = rows_of(found)
    assert record["attacks"] == {
        "fixes": ("gnss-relocate",),
        "messages": ("cam-sybil-congestion",),
        "clouds": ("detach",),
    }
    assert 1.0 < record["from_s"] < 1.2
    assert record["to_s"] == 1.5
    assert record["own_place_m_clean"] < 6
    assert 10 < record["own_place_m"] < 81
    assert 2 < record["map_wrong"] - record["map_wrong_clean"] <= 6
    frames = pq.read_table(attacked_bag / "frames.parquet").to_pylist()
    gone = [row["points_clean"] - row["points_adversarial"] for row in frames]
    assert [bool(count) for count in gone] == [False, False, True, True, False, False]
    assert (record["points_touched_clean"], record["points_touched"]) == (0, gone[3])  # 1.5 s alone


def test_the_picture_is_the_same_again(found: ReportSection, smoke: Path, attacked_bag: Path) -> None:
    (again,) = coordinated_sections(smoke, [attacked_bag], 1)
    (picture,) = found.pictures
    assert picture.section == SECTION
    assert picture.file_name == "three-ego-coordinated.png"
    assert picture.png.startswith(b"\x89PNG")
    assert picture.png == again.pictures[0].png


def test_one_kind_alone_is_not_coordinated(smoke: Path, tmp_path: Path) -> None:
    attack(smoke, tmp_path / "gps", AttackRequest((GPS,), 7))
    attack(smoke, tmp_path / "jam", AttackRequest((JAM,), 7))
    assert coordinated_sections(smoke, [tmp_path / "gps", tmp_path / "jam"]) == ()
    assert coordinated_sections(smoke, []) == ()


def test_one_after_the_other_is_said(smoke: Path, tmp_path: Path) -> None:
    """Messages that aim at nobody strike who listens; a receiver that is spoofed when they are over."""
    spec = AttackSpec(type="cam-heading-reversed", schedule=Schedule(to_s=0.9))
    attack(smoke, tmp_path / "both", AttackRequest((GPS, spec), 7))
    (found,) = coordinated_sections(smoke, [tmp_path / "both"])
    expected = "both: gnss-relocate and cam-heading-reversed attack ego, but never at the same time."
    assert found.lead == expected
    assert len(found.tables) == 1
    (record,) = rows_of(found)
    assert "own_place_m" not in record


def test_a_window_counts_the_attacks_and_effects_in_it(
    smoke: Path, attacked_bag: Path, found: ReportSection
) -> None:
    """From 1.2 to 1.7 s: five fixes, the cloud of 1.5 s alone; means of the time that they share in it."""
    begin_ns = int(BagReader(smoke).log_times_ns("/ego/odometry")[0])
    window = Window(begin_ns + 1_200_000_000, begin_ns + 1_700_000_000)
    (part,) = coordinated_sections(smoke, [attacked_bag], window=window)
    sent = pq.read_table(attacked_bag / "v2x_labels.parquet").to_pylist()
    inside = sum(
        window.begin_ns <= row["time_ns"] < window.end_ns
        for row in sent
        if row["attack"] == "cam-sybil-congestion"
    )
    assert [line[3] for line in part.tables[0].lines] == ["5 fixes", f"{inside} messages", "1 cloud"]
    (record,), (whole,) = rows_of(part), rows_of(found)
    assert (record["from_s"], record["to_s"]) == (1.5, 1.5)
    assert record["points_touched"] == whole["points_touched"]
    (everything,) = coordinated_sections(smoke, [attacked_bag], window=Window(begin_ns, begin_ns + 10**10))
    np.testing.assert_equal(everything, found)


def test_a_window_before_it_names_the_bag_alone(smoke: Path, attacked_bag: Path) -> None:
    begin_ns = int(BagReader(smoke).log_times_ns("/ego/odometry")[0])
    (early,) = coordinated_sections(smoke, [attacked_bag], window=Window(begin_ns, begin_ns + 900_000_000))
    assert early.lead == "three: no vehicle is attacked in two ways in this window."
    assert (early.tables, early.records, early.pictures) == ((), (), ())


def test_together() -> None:
    def timeline(*times_ns: int) -> AttackTimeline:
        return AttackTimeline("ego", ("attack",), "fixes", np.array(times_ns))

    assert together([timeline(1, 9), timeline(4, 12), timeline(3, 7)]) == (4, 7)
    assert together([timeline(1, 4), timeline(4)]) == (4, 4)
    assert together([timeline(1, 3), timeline(4, 5)]) is None


def test_labels_that_are_none(smoke: Path, attacked_bag: Path, tmp_path: Path) -> None:
    for file in attacked_bag.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "frames.parquet").write_text("no labels")
    with pytest.raises(AdvpipeError, match=r"frames.parquet holds no cloud labels: .*; attack again"):
        coordinated_sections(smoke, [tmp_path])
