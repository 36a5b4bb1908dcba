"""`advpipe run`: all stages of a small scenario, again, and with other attacks."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.cli.run import run
from advpipe.pipeline.cli.simulate import simulate_command
from advpipe.pipeline.core.errors import AdvpipeError, UsageError

SCENARIO = """
name: tiny
simulation: {seed: 1, duration_s: 1, warmup_s: 1}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 60, pedestrians: 5, parked_per_km: 60}
sensors: {lidars: {lidar: {channels: 32, points_per_second: 144000}}}
recording: {markers: false}
attacks:
  fewer_points: {type: detach, recipe: random, parameters: {ratio: 0.1}, frames: "::5"}
  false_speed:
    type: cam-speed-constant
    attackers: {share: 0.5}
"""


def stamps(folder: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = Path("tiny.yaml")
    path.write_text(SCENARIO, encoding="utf-8")
    return path


def test_all_stages_and_again(
    scenario: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Path("out")
    run(str(scenario), made)
    assert {"clean", "fewer_points", "false_speed", "reports"} <= {path.name for path in made.iterdir()}
    report = json.loads((made / "reports" / "small" / "report.json").read_text())
    assert [row["attack"] for row in report["rows"]] == ["detach"]
    before = stamps(made)
    capsys.readouterr()
    run(str(scenario), made)
    assert capsys.readouterr().out.splitlines() == [
        "out/clean: kept",
        "out/fewer_points: kept",
        "out/false_speed: kept",
        "out/reports/small: kept",
    ]
    assert stamps(made) == before

    # Clouds presented otherwise are another report, and another attack.
    with pytest.raises(UsageError, match="fewer_points was made with other"):
        run(str(scenario), made, lidar_height_m=2.0)

    # Other code would report otherwise.
    with monkeypatch.context() as other:
        other.setattr("advpipe.pipeline.campaigns.run.code_sha256", lambda *parts: "7" * 64)
        with pytest.raises(AdvpipeError, match="out/reports/small already exists"):
            run(str(scenario), made)
    assert stamps(made) == before

    with monkeypatch.context() as other:
        other.setattr("advpipe.stages.attack.provenance.code_sha256", lambda *parts: "7" * 64)
        with pytest.raises(AdvpipeError, match="fewer_points was made with other code_sha256"):
            run(str(scenario), made)
    assert stamps(made) == before

    # Another attack under an old name: the drive and the other bag are kept, the rest is asked about.
    scenario.write_text(SCENARIO.replace("ratio: 0.1", "ratio: 0.2"), encoding="utf-8")
    with pytest.raises(
        AdvpipeError, match=r"fewer_points was made with other attacks, parameters .*--overwrite"
    ):
        run(str(scenario), made)
    assert stamps(made) == before
    capsys.readouterr()
    run(str(scenario), made, overwrite=True)
    said = capsys.readouterr().out
    assert "out/clean: kept" in said
    assert "out/false_speed: kept" in said
    assert "out/fewer_points: kept" not in said
    changed = {path for path, stamp in stamps(made).items() if before.get(path) != stamp}
    assert changed
    assert all("fewer_points" in path or "reports" in path for path in changed)

    # Another drive in the same place.
    with pytest.raises(AdvpipeError, match="out holds the drive of another scenario; pass --overwrite"):
        run(str(scenario), made, ["simulation.seed=2"])


@pytest.mark.parametrize(
    ("attacks", "line"),
    [
        ("{a: {type: detatch}}", "unknown attack 'detatch'; did you mean 'detach'"),
        ("{a: {type: detach}}", "ratio is missing"),
        ("{a: {type: detach, parameters: {ratio: 2}}}", "ratio is 2"),
        ("{a: {type: cam-dos, parameters: {rate: 2}}}", "cam-dos: unknown parameter 'rate'"),
        (
            "{a: {type: detatch}, b: {type: detach, recipe: bets}, c: {type: cam-drop}}",
            r": 3 mistakes: \(1\) attacks.a \(line \d+\): unknown attack .*; "
            r"\(2\) attacks.b \(line \d+\): detach: ratio is missing; add it to `parameters`; "
            r"\(3\) attacks.b .*recipe",
        ),
        (  # those of the schema in the same round, and each with its place
            "{a: [{type: detach, parameters: {ration: 1%, rounds: x}}, "
            "{type: cam-drop, recipe: best, lidr: 1}]}",
            r": 4 mistakes: \(1\) attacks.a\[1\].lidr \(line \d+\): cam-drop: unknown key; "
            r"did you mean 'lidar'.*; "
            r"\(2\) attacks.a\[0\] \(line \d+\): detach: unknown parameter 'ration'.*; "
            r"\(3\) attacks.a\[0\] \(line \d+\): detach: rounds is 'x'.*; "
            r"\(4\) attacks.a\[1\] \(line \d+\): cam-drop has no use for recipe",
        ),
        (
            "{a: [{type: cam-drop}, {type: gnss-jump, victim: he}]}",
            r"attacks.a\[1\] \(line \d+\): gnss-jump names the victim 'he'",
        ),
    ],
)
def test_bad_attacks_are_refused_before_anything_is_simulated(
    scenario: Path, attacks: str, line: str
) -> None:
    text = SCENARIO[: SCENARIO.index("attacks:")] + f"attacks: {attacks}\n"
    scenario.write_text(text, encoding="utf-8")
    with pytest.raises(AdvpipeError, match=line):
        run(str(scenario), Path("out"))
    assert not Path("out").exists()


@pytest.mark.parametrize("command", [run, lambda scenario, out: simulate_command([scenario], out)])
def test_all_mistakes_come_at_once_before_the_drive(scenario: Path, command: Callable[..., object]) -> None:
    wrong = SCENARIO.replace("seed: 1", "seed: many").replace("vehicles: 60", "mix: {tank: 1}, vehicles: 60")
    wrong = wrong.replace("boulevard.net.xml", "nowhere.net.xml").replace("type: detach", "type: detatch")
    scenario.write_text(wrong, encoding="utf-8")
    with pytest.raises(UsageError) as caught:
        command(str(scenario), Path("out"))
    line = str(caught.value)
    assert ": 4 mistakes: " in line
    for words in ("seed", "tank is not a known body", "did you mean 'detach'", "nowhere.net.xml' does not"):
        assert words in line
    assert not Path("out").exists()
