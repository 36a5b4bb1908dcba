"""The command line: light help, one-line errors, and the three stages with nothing but defaults."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = ("torch", "open3d", "libsumo", "numpy", "rosbags", "matplotlib", "pydantic", "scipy")


def advpipe(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from advpipe.pipeline.cli import app; app()", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys, contextlib, io\n"
        "from advpipe.pipeline.cli import app\n"
        "with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):\n"
        "    app(['--help'])\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], len(text.getvalue()))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded, length = done.stdout.rsplit(" ", 1)
    assert loaded == "[]"
    assert int(length) > 300


@pytest.mark.parametrize("command", ["simulate", "attack", "evaluate", "train", "inspect"])
def test_every_command_explains_itself(command: str) -> None:
    done = advpipe(command, "--help")
    assert done.returncode == 0
    assert command in done.stdout


MISTAKES = {
    "unknown scenario": (["simulate", "boulevrd"], "did you mean 'boulevard'"),
    "unknown key": (["simulate", "smoke", "--set", "simulation.seeds=1"], "did you mean 'seed'"),
    "negative duration": (["simulate", "smoke", "--set", "simulation.duration_s=-1"], "greater than 0"),
    "missing map": (["simulate", "town06"], "give its path with --set map.opendrive=FILE"),
    "no data set": (["attack"], "datasets"),
    "no data set to score": (["evaluate"], "datasets"),
    "missing bag": (["inspect", "nowhere"], "nowhere"),
    "missing bag to attack": (["attack", "nowhere"], "nowhere"),
    "unknown attack": (["attack", "empty", "--type", "explode"], "empty"),
}


@pytest.mark.parametrize(("words", "message"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_costs_one_line(tmp_path: Path, words: list[str], message: str) -> None:
    (tmp_path / "empty").mkdir()
    done = advpipe(*words, folder=tmp_path)
    assert done.returncode == 1
    assert message in done.stderr
    assert done.stderr.startswith("advpipe: ")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]


def test_the_three_stages_with_defaults(tmp_path: Path) -> None:
    """The path a new user takes, on the smoke scenario: bags, labels and a report come out."""
    assert advpipe("simulate", "smoke", folder=tmp_path).returncode == 0
    again = advpipe("simulate", "smoke", folder=tmp_path)
    assert again.returncode == 1
    assert "--overwrite" in again.stderr
    attacked = advpipe("attack", "--type", "detach", "--frames", "0:4:2", folder=tmp_path)
    assert attacked.returncode == 0, attacked.stderr
    adversarial = tmp_path / "datasets" / "smoke" / "detach-best-0.01"
    assert {"metadata.yaml", "attack.yaml", "labels.parquet"} <= {path.name for path in adversarial.iterdir()}
    evaluated = advpipe("evaluate", folder=tmp_path)
    assert evaluated.returncode == 0, evaluated.stderr
    assert "detach" in evaluated.stdout
    report = tmp_path / "datasets" / "smoke" / "reports" / "small"
    (row,) = json.loads((report / "report.json").read_text())["rows"]
    assert row["frames"] == 2
    assert row["points_added"] == 0
    assert row["points_removed"] > 0
    assert "<img" in (report / "report.html").read_text()
    described = advpipe("inspect", str(adversarial), "--json", folder=tmp_path)
    assert json.loads(described.stdout)["provenance"]["attack"] == "detach"
