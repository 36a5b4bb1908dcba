"""A drive of a LiDAR that a detector does not expect: it is told, and options make it good."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

import advpipe
from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.lidar_mount import base_link_SE3_lidar
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.option_names import use_flags
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.adapted import adapted_detector
from advpipe.pipeline.detector.input_notice import notice_unexpected_input
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.ground_plane import GroundPlane, fit_ground
from advpipe.pipeline.messages.cloud import cloud_to_cdr, xyz
from advpipe.pipeline.messages.topics import TF_STATIC, VehicleTopics
from advpipe.stages.evaluate.detection.scoring import CachedDetector, found_objects, ground_truth, match

sys.path.insert(0, str(Path(__file__).parent))

from raised_bag import record_raised

CLEAN = shipped_sample() / "clean"
LIDAR = VehicleTopics().lidar_points.name

Record = Callable[..., Path]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """A bag of the sample's drive with another LiDAR, made once for each."""
    made: dict[tuple[tuple[str, float], ...], Path] = {}

    def make(**lidar: float) -> Path:
        key = tuple(sorted(lidar.items()))
        if key not in made:
            made[key] = record_raised(CLEAN, tmp_path_factory.mktemp("raised") / "clean", **lidar)
        return made[key]

    return make


def found_by(bag: Path, adaptation: Adaptation | None = None) -> int:
    """How many objects `small` finds in the three clouds."""
    detector = CachedDetector(adapted_detector(load_detector("small"), adaptation or Adaptation()))
    found = 0
    for frame in read_frames(bag):
        truth = ground_truth(frame, detector.classes, detector.range_m)
        matches = match(truth, detector.detect(frame.cloud), detector.classes, ("loose",))
        found += int(found_objects(matches, 0.2).sum())
    return found


def notices(bag: Path, capsys: pytest.CaptureFixture[str], adaptation: Adaptation | None = None) -> list[str]:
    capsys.readouterr()
    detector = load_detector("small")
    with use_flags():
        notice_unexpected_input(BagReader(bag), LIDAR, "small", detector, adaptation or Adaptation())
    return [line.removeprefix(f"note: {bag}: ") for line in capsys.readouterr().err.splitlines()]


def test_a_raised_lidar_costs_recall_and_the_options_bring_it_back(recorded: Record) -> None:
    raised, before = recorded(up_m=3.2), found_by(CLEAN)
    assert found_by(raised) < 0.2 * before
    assert found_by(raised, Adaptation(5.0)) == before
    assert found_by(raised, Adaptation(level=True)) >= 0.8 * before
    assert found_by(recorded(up_m=0.3, pitch_rad=0.08), Adaptation(level=True)) >= 0.8 * before


def test_what_is_tolerated_costs_little(recorded: Record) -> None:
    assert found_by(recorded(up_m=0.4)) >= 0.65 * found_by(CLEAN)


def test_bright_clouds(recorded: Record) -> None:
    bright, before = recorded(intensity=255.0), found_by(CLEAN)
    assert found_by(bright) < before
    assert found_by(bright, Adaptation(scale_intensity=1 / 255)) == before


def test_the_ground_of_a_simulated_drive_is_where_the_mount_says() -> None:
    (frame,) = read_frames(CLEAN, FrameSlice(0, 1))
    plane = fit_ground(xyz(frame.cloud))
    assert isinstance(plane, GroundPlane)
    # The road's, or that of the pavements beside it, which are a kerb of 12 cm higher.
    assert 1.67 < plane.height_m < 1.81
    assert np.degrees(plane.tilt_rad) < 0.2


def test_the_mount_is_read(recorded: Record) -> None:
    raised = recorded(up_m=0.4)
    pose = base_link_SE3_lidar(BagReader(raised), "ego/lidar")
    assert pose is not None
    assert pose[2, 3] == pytest.approx(2.2)
    assert base_link_SE3_lidar(BagReader(raised), "elsewhere") is None


def test_what_differs_is_told(recorded: Record, capsys: pytest.CaptureFixture[str]) -> None:
    assert notices(CLEAN, capsys) == []
    raised = recorded(up_m=3.2)
    assert notices(raised, capsys) == [
        "its LiDAR is 5.00 m above the ground, small expects 1.80 m; give --lidar-height 5.0 or --level"
    ]
    assert notices(raised, capsys) == []  # once in a process
    assert notices(raised, capsys, Adaptation(5.0)) == []
    assert notices(raised, capsys, Adaptation(level=True)) == []
    assert notices(raised, capsys, Adaptation(1.4)) == [
        "its LiDAR is 5.00 m above the ground, the option says 1.40 m; give --lidar-height 5.0 or --level"
    ]
    assert notices(recorded(up_m=0.3, pitch_rad=0.08), capsys, Adaptation(2.1)) == [
        "its LiDAR is tilted by 4.6°, small expects level ground; give --level"
    ]
    assert notices(recorded(intensity=255.0), capsys) == [
        "its intensities go up to 255, small expects up to 1; give --scale-intensity 0.00392157"
    ]
    assert notices(recorded(intensity=255.0), capsys, Adaptation(scale_intensity=1 / 255)) == []


def test_the_ground_is_fitted_although_a_mount_is_stated(
    recorded: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mount that the source states, such as KITTI's, may not be that of the clouds."""

    def as_mounted_before(seen: Path, name: str) -> Path:
        static = list(BagReader(CLEAN).raw_messages([TF_STATIC.name]))
        clouds = list(BagReader(seen).raw_messages([LIDAR]))
        with BagWriter(tmp_path / name, provenance={}) as bag:
            for raw in (*static, *clouds):
                bag.copy(raw)
        return tmp_path / name

    tilted = as_mounted_before(recorded(pitch_rad=0.08), "tilted")
    (line,) = notices(tilted, capsys)
    assert line == "its LiDAR is tilted by 4.6°, small expects level ground; give --level"
    assert notices(tilted, capsys, Adaptation(level=True)) == []
    raised = as_mounted_before(recorded(up_m=3.2), "raised")
    (line,) = notices(raised, capsys)
    told = re.fullmatch(
        r"its LiDAR is (4\.8\d|4\.9\d|5\.00) m above the ground of the first cloud "
        r"\(its mount says 1\.80 m\), small expects 1\.80 m; give --lidar-height ([\d.]+) or --level",
        line,
    )
    assert told is not None
    assert float(told[1]) == float(told[2])
    assert notices(raised, capsys, Adaptation(5.0)) == []


def test_without_a_mount_the_ground_decides(
    recorded: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (frame,) = read_frames(recorded(up_m=3.2), FrameSlice(0, 1))
    for name, cloud in (("raised", frame.cloud), ("empty", frame.cloud[:10])):
        with BagWriter(tmp_path / name, provenance={}) as bag:
            bag.write_cdr(VehicleTopics().lidar_points, cloud_to_cdr(cloud, 0, "ego/lidar"), 0)
    (line,) = notices(tmp_path / "raised", capsys)
    assert re.match(r"its LiDAR is (4\.8\d|4\.9\d|5\.00) m above the ground", line)
    assert notices(tmp_path / "empty", capsys) == []
    (line,) = notices(tmp_path / "empty", capsys, Adaptation(level=True))
    assert line.startswith("--level does not level the first cloud: only ")


def test_a_report_and_a_bag_say_how_clouds_were_shown(recorded: Record, tmp_path: Path) -> None:
    raised, options = recorded(up_m=3.2), {"lidar_height_m": 5.0, "level": True}
    attacked = advpipe.attack(
        raised,
        type="perturb",
        eps_cm=20,
        frames="0:1",
        out=tmp_path / "bag",
        steps=6,
        **options,
    )
    assert attacked.unchanged == 0
    before, after = attacked.mean_losses
    assert after > 1.05 * before  # the gradient reaches the points of a tilted frame
    (one,) = yaml.safe_load((tmp_path / "bag" / "attack.yaml").read_text(encoding="utf-8"))["attacks"]
    assert {key: one.get(key) for key in ("lidar_height_m", "level", "scale_intensity")} == {
        **options,
        "scale_intensity": None,
    }
    report = advpipe.evaluate(
        raised, attacked, out=tmp_path / "report", baseline=False, scene=False, workers=1, level=True
    )
    stored = json.loads((tmp_path / "report" / "report.json").read_text(encoding="utf-8"))
    assert stored["provenance"]["adaptation"] == {
        "lidar_height_m": None,
        "level": True,
        "scale_intensity": 1.0,
    }
    assert "levelled by the ground fitted in each" in stored["formulas"]["adaptation"]
    (row,) = report.to_dicts()
    assert row["map_adv"] < row["map_clean"]
    assert any("saw clouds otherwise: with lidar_height_m=5.0" in note for note in row["notes"])


def test_an_attack_on_clouds_as_they_are_does_not_mention_it(tmp_path: Path) -> None:
    advpipe.attack(CLEAN, type="detach", recipe="random", frames="0:1", out=tmp_path / "bag")
    text = (tmp_path / "bag" / "attack.yaml").read_text(encoding="utf-8")
    assert "level" not in text
    assert "scale_intensity" not in text


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"lidar_height_m": -1.0}, "lidar_height_m"),
        ({"scale_intensity": 0.0}, "scale_intensity"),
        ({"scale_intensity": float("nan")}, "scale_intensity"),
    ],
)
def test_mistakes(tmp_path: Path, options: dict[str, float], line: str) -> None:
    with pytest.raises(advpipe.AdvpipeError, match=line):
        advpipe.attack(CLEAN, out=tmp_path / "bag", **options)
    with pytest.raises(advpipe.AdvpipeError, match=line):
        advpipe.evaluate(CLEAN, out=tmp_path / "report", **options)
