"""`advpipe run`: all stages of a small scenario, again, and with other attacks."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCENARIO = """
name: tiny
simulation: {seed: 1, duration_s: 1, warmup_s: 5}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 20, pedestrians: 5}
sensors: {lidars: {lidar: {channels: 16, points_per_second: 20000}}}
recording: {markers: false}
attacks:
  fewer_points: {type: detach, recipe: random, parameters: {ratio: 0.1}, frames: "::5"}
  false_speed:
    type: cam-speed-constant
    attackers: {share: 0.5}
"""


def advpipe(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from advpipe.pipeline.cli import app; app()", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)


def stamps(folder: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_all_stages_and_again(tmp_path: Path) -> None:
    (tmp_path / "tiny.yaml").write_text(SCENARIO, encoding="utf-8")
    words = ["run", "tiny.yaml", "--out", "out"]
    first = advpipe(tmp_path, *words)
    assert first.returncode == 0, first.stderr
    made = tmp_path / "out"
    assert {"clean", "fewer_points", "false_speed", "reports"} <= {path.name for path in made.iterdir()}
    report = json.loads((made / "reports" / "small" / "report.json").read_text())
    assert [row["attack"] for row in report["rows"]] == ["detach"]
    before = stamps(made)
    again = advpipe(tmp_path, *words)
    assert again.returncode == 0, again.stderr
    assert again.stdout.splitlines() == [
        "out/clean: kept",
        "out/fewer_points: kept",
        "out/false_speed: kept",
        "out/reports/small: kept",
    ]
    assert stamps(made) == before

    # Another attack under an old name: the drive and the other bag are kept, the rest is asked about.
    (tmp_path / "tiny.yaml").write_text(SCENARIO.replace("ratio: 0.1", "ratio: 0.2"), encoding="utf-8")
    refused = advpipe(tmp_path, *words)
    assert refused.returncode == 1
    assert refused.stderr.startswith("advpipe: out/fewer_points exists already, not overwriting")
    assert stamps(made) == before
    replaced = advpipe(tmp_path, *words, "--overwrite")
    assert replaced.returncode == 0, replaced.stderr
    assert "out/clean: kept" in replaced.stdout
    assert "out/false_speed: kept" in replaced.stdout
    assert "out/fewer_points: kept" not in replaced.stdout
    changed = {path for path, stamp in stamps(made).items() if before.get(path) != stamp}
    assert all("fewer_points" in path or "reports" in path for path in changed)

    # Another drive in the same place.
    other = advpipe(tmp_path, *words, "--set", "simulation.seed=2")
    assert (other.returncode, other.stderr.count("\n")) == (1, 1)
    assert "out holds the drive of another scenario; pass --overwrite" in other.stderr


@pytest.mark.parametrize(
    ("attacks", "line"),
    [
        ("{a: {type: detatch}}", "unknown attack 'detatch'; known: detach"),
        ("{a: {type: detach}}", "ratio is missing"),
        ("{a: {type: detach, parameters: {ratio: 2}}}", "ratio is 2"),
        ("{a: {type: cam-dos, parameters: {rate: 2}}}", "cam-dos: unknown parameter 'rate'"),
    ],
)
def test_bad_attacks_are_refused_before_anything_is_simulated(
    tmp_path: Path, attacks: str, line: str
) -> None:
    text = SCENARIO[: SCENARIO.index("attacks:")] + f"attacks: {attacks}\n"
    (tmp_path / "tiny.yaml").write_text(text, encoding="utf-8")
    done = advpipe(tmp_path, "run", "tiny.yaml", "--out", "out")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert line in done.stderr
    assert not (tmp_path / "out").exists()
