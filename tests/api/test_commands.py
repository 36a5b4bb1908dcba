"""A script of a user, without a guard for its main module: all that it may do with a short drive."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import advpipe

SCRIPT = """
import json
import advpipe

print("begin")
drive = advpipe.simulate(advpipe.load_scenario("smoke", {"simulation.duration_s": 1}), out="drive")
half = advpipe.attack(drive, type="detach", recipe="random", ratio=0.5, out="half", workers=2)
changes = {"attacker": "50%", "speed_mps": 30.0, "out": "falsified"}
falsified = advpipe.attack("drive", type="cam-speed-constant", **changes)
moved = advpipe.attack(drive, type="gnss-bias", parameters={"bound_m": 5.0}, out="moved")
report = advpipe.evaluate(drive, falsified, out="report")
checked = advpipe.verify("half")
results = [drive, half, falsified, moved, report, checked]
print(json.dumps({"reprs": [repr(each) for each in results], "tables": [each.to_dicts() for each in results],
    "html": [each._repr_html_() for each in results],
    "v2x": report.to_dicts("v2x"), "good": checked.is_good}))
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the script ran; what it printed is in results.json."""
    folder = tmp_path_factory.mktemp("script")
    (folder / "script.py").write_text(SCRIPT, encoding="utf-8")
    ran = subprocess.run([sys.executable, "script.py"], cwd=folder, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    begin, printed = ran.stdout.splitlines()
    assert begin == "begin"  # once: worker processes do not run the script again
    (folder / "results.json").write_text(printed)
    return folder


def test_results_tell_themselves(done: Path) -> None:
    shown_results = json.loads((done / "results.json").read_text())
    starts = ["<SimulationSummary drive/clean: 10 frames, 10 clouds", "<AttackSummary half: 10 frames, 10"]
    starts += ["<AttackSummary falsified: new messages on", "<AttackSummary moved: ", "<Report report: V2X"]
    starts += ["<Verification half: good>"]
    for shown, start in zip(shown_results["reprs"], starts, strict=True):
        assert shown.startswith(start)
        assert "\n" not in shown
    for html in shown_results["html"]:
        assert html.startswith("<")
        assert html.count("<table>") == html.count("</table>")
    assert shown_results["good"]


def test_their_tables_have_the_figures(done: Path) -> None:
    shown_results = json.loads((done / "results.json").read_text())
    (drive,), (half,), (false_cams,), *_ = shown_results["tables"]
    assert drive["frames"] == 10
    assert half["points_clean"] == drive["points"]
    assert 0.49 < half["points_adversarial"] / half["points_clean"] < 0.51
    assert false_cams["CAMs changed"] > 0
    report = json.loads((done / "report" / "report.json").read_text())
    stated = [
        {key: row[key] for key in mine} for row, mine in zip(report["v2x"], shown_results["v2x"], strict=True)
    ]
    assert [{**mine, "attacks": None} for mine in shown_results["v2x"]] == [
        {**row, "attacks": None} for row in stated
    ]
    assert shown_results["tables"][4] == report["rows"] == []


def test_a_bag_gives_clouds_boxes_cams_and_fixes(done: Path) -> None:
    clean, falsified, moved = (advpipe.open_bag(done / name) for name in ("drive", "falsified", "moved"))
    frames = list(clean.frames("2:8:3"))
    assert [frame.index for frame in frames] == [2, 5]
    assert frames[1].stamp_ns - frames[0].stamp_ns == 300_000_000
    assert frames[0].cloud.dtype == advpipe.POINT_DTYPE
    assert frames[0].boxes.geometry.shape == (len(frames[0].boxes), len(advpipe.BOX_COLUMNS))
    assert clean.frame(5).cloud.tobytes() == frames[1].cloud.tobytes()
    true, false_cams = clean.sent_cams(), falsified.sent_cams()
    assert len(true) == len(false_cams)
    other = true["speed_mps"] != false_cams["speed_mps"]
    assert other.any()
    assert (false_cams["speed_mps"][other] == 30.0).all()
    heard = clean.cams()
    assert set(heard["station_id"]) <= set(true["station_id"])
    assert (heard["power_dbm"] < 0).all()
    off_deg = moved.fixes()["latitude_deg"] - clean.fixes()["latitude_deg"]
    assert len(off_deg) == clean.topics["/ego/gnss/fix"].count
    assert 1e-7 < abs(off_deg).max() < 1e-4  # 5 m are 4.5e-5 degrees at most
    assert "drive/clean" in repr(clean)
    assert clean.provenance["kind"] == "clean"
    times_ns = [time_ns for time_ns, _ in clean.messages("/clock")]
    assert times_ns == sorted(times_ns)


def test_mistakes_are_one_line(done: Path, tmp_path: Path) -> None:
    bag = advpipe.open_bag(done / "drive")
    with pytest.raises(advpipe.UsageError, match="bus receives no CAMs; vehicles that do: ego"):
        bag.cams("bus")
    with pytest.raises(
        advpipe.UsageError, match=r"eggo has no GPS; did you mean 'ego'\? vehicles that do: ego"
    ):
        bag.fixes("eggo")
    with pytest.raises(advpipe.UsageError, match=r"no topic /clok; did you mean '/clock'\?"):
        next(bag.messages("/clok"))
    with pytest.raises(advpipe.UsageError, match="does not exist"):
        advpipe.open_bag(tmp_path / "nothing")
    with pytest.raises(advpipe.UsageError, match="expected start:stop:step"):
        bag.frames("one")
    with pytest.raises(advpipe.UsageError, match="ratio' is given twice"):
        advpipe.attack(done / "drive", ratio=0.1, parameters={"ratio": 0.2})
    with pytest.raises(advpipe.UsageError, match="pass them to load_scenario"):
        advpipe.simulate(advpipe.load_scenario("smoke"), settings=["simulation.duration_s=1"])
    with pytest.raises(advpipe.UsageError, match="already exists"):
        advpipe.simulate("smoke", out=done / "drive")
