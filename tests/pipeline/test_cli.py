"""The command line: light help, one-line errors, and the three stages with nothing but defaults."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from first_words import without_progress

from advpipe.pipeline.cli import COMMANDS, app

HEAVY = ("torch", "open3d", "libsumo", "numpy", "rosbags", "matplotlib", "pydantic", "rich", "scipy")


def advpipe(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """In a process of its own, as its user runs it."""
    command = [sys.executable, "-m", "advpipe", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


Run = Callable[..., Done]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """The same in this process, in the test's folder: without a second of imports each time."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Done:
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            app(list(arguments), prog_name="advpipe")
        out, errors = capfd.readouterr()
        return Done(int(ended.value.code or 0), out, without_progress(errors))

    return run


@pytest.mark.parametrize("arguments", [["--help"], ["attack", "--help"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import sys, contextlib, io\n"
        "from advpipe.pipeline.cli import app\n"
        "with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):\n"
        f"    app({arguments})\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], len(text.getvalue()))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded, length = done.stdout.rsplit(" ", 1)
    assert loaded == "[]"
    assert int(length) > 300


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(run: Run, command: str) -> None:
    done = run(command, "--help")
    assert done.returncode == 0
    assert command in done.stdout


def test_the_help_of_attacks_says_what_the_attacker_knows_and_what_a_miss_is(run: Run) -> None:
    """In README.md's words, of which the tests work out the centimetres."""
    found = run("attack", "--type", "perturb", "--help").stdout
    help_text = " ".join(re.sub(r"[│╭╮╰╯─]", " ", found).split())
    assert "knows the detector, the true boxes and the rule that matches detections to them" in help_text
    assert "a miss from 13 cm along all three axes at once, 32 cm sideways" in help_text
    assert '"hide" objects: no box that overlaps them loosely is left' in help_text
    assert "random-best (the strongest)" in help_text


MISTAKES = {
    "unknown scenario": (["simulate", "boulevrd"], "did you mean 'boulevard'"),
    "unknown key": (["simulate", "smoke", "--set", "simulation.seeds=1"], "did you mean 'seed'"),
    "negative duration": (
        ["simulate", "smoke", "--set", "simulation.duration_s=-1"],
        "greater than or equal to 0.001",
    ),
    "missing map": (
        ["simulate", "town06"],
        "map.opendrive: Town06.xodr does not exist; give its path with --set map.opendrive=FILE",
    ),
    "no data set": (["attack"], "datasets"),
    "no data set to score": (["evaluate"], "datasets"),
    "missing bag": (["inspect", "nowhere"], "nowhere"),
    "nothing to recover from": (["recover", "nowhere"], "nowhere holds no .mcap file, and no killed run"),
    "no recording at all": (["recover", "file"], "file is empty"),
    "schema over a file": (["schema", "-o", "file"], "--overwrite"),
    "schema nowhere": (["schema", "-o", "nowhere/x"], "nowhere/x: No such file"),
    "missing bag to attack": (["attack", "nowhere"], "nowhere"),
    "no bag in the folder": (["attack", "empty"], "empty is not a bag"),
    "output in /proc": (["simulate", "smoke", "-o", "/proc/foo/x"], "/proc/foo: No such file or directory"),
    "output below a file": (["simulate", "smoke", "-o", "file/x"], "file"),
    "output with a long name": (["simulate", "smoke", "-o", "x" * 250], ": File name too long"),
    "rate of nan": (["train", "empty", "-o", "out", "--learning-rate", "nan"], "--learning-rate is nan"),
    "rate without end": (["train", "empty", "-o", "out", "--learning-rate", "inf"], "finite and above 0"),
}


ONLY_THE_ATTEMPT_SHOWS = (
    "schema nowhere",
    "output in /proc",
    "output below a file",
    "output with a long name",
)
"""Exit code 1, for what the system refuses; the others are wrong use, 2."""


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_reported_in_one_line(run: Run, tmp_path: Path, mistake: str) -> None:
    arguments, message = MISTAKES[mistake]
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    done = run(*arguments)
    assert done.returncode == (1 if mistake in ONLY_THE_ATTEMPT_SHOWS else 2)
    assert message in done.stderr
    assert done.stderr.startswith("advpipe: ")
    assert done.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "file"]


@pytest.mark.parametrize("command", ["attack", "evaluate", "train"])
def test_negative_seeds_are_refused(run: Run, command: str) -> None:
    done = run(command, "bag", "--seed", "-1")
    assert done.returncode == 2
    assert "--seed" in done.stderr


@pytest.mark.parametrize("recipe", ["random", pytest.param("best", marks=pytest.mark.nightly)])
def test_the_three_stages_with_defaults(run: Run, tmp_path: Path, recipe: str) -> None:
    """The path a new user takes, on the smoke scenario: bags, labels and a report come out.

    At night with nothing but defaults, each stage in a process of its own; otherwise in this process, with a
    recipe that needs no gradient and no baseline.
    """
    stage = partial(advpipe, folder=tmp_path) if recipe == "best" else run
    assert stage("simulate", "smoke").returncode == 0
    again = run("simulate", "smoke")
    assert again.returncode == 2
    assert "--overwrite" in again.stderr
    unknown = run("attack", "--type", "explode")
    assert unknown.returncode == 2
    assert "explode" in unknown.stderr
    assert "most like it: " in unknown.stderr
    assert unknown.stderr.count("\n") == 1
    (tmp_path / "file").touch()
    for arguments in (["attack", "-o", "file/x"], ["train", "datasets/smoke", "-o", "file/y"]):
        refused = run(*arguments)
        assert refused.returncode in (1, 2)
        assert refused.stderr.startswith("advpipe: file")
        assert refused.stderr.count("\n") == 1
    chosen = [] if recipe == "best" else ["--recipe", recipe]
    attacked = stage("attack", "--type", "detach", "--frames", "0:1", *chosen)
    assert attacked.returncode == 0, attacked.stderr
    adversarial = tmp_path / "datasets" / "smoke" / f"detach-{recipe}-0.01"
    assert {"metadata.yaml", "attack.yaml", "labels.parquet"} <= {path.name for path in adversarial.iterdir()}
    evaluated = stage("evaluate")
    assert evaluated.returncode == 0, evaluated.stderr
    assert "detach" in evaluated.stdout
    report = tmp_path / "datasets" / "smoke" / "reports" / "small"
    (row,) = json.loads((report / "report.json").read_text())["rows"]
    assert row["frames"] == 1
    assert row["points_added"] == 0
    assert row["points_removed"] > 0
    assert "<img" in (report / "report.html").read_text()
    described = run("inspect", str(adversarial), "--json")
    assert json.loads(described.stdout)["provenance"]["attack"] == "detach"
    assert_quiet_when_nobody_reads(tmp_path / "datasets" / "smoke")


def assert_quiet_when_nobody_reads(bag: Path) -> None:
    command = [sys.executable, "-m", "advpipe", "inspect", str(bag)]
    pipe = subprocess.PIPE
    for more, unbuffered in (([], ""), (["--json"], "1")):
        environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        with subprocess.Popen([*command, *more], stdout=pipe, stderr=pipe, env=environment) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            assert without_progress(process.stderr.read().decode()) == ""
        assert process.returncode == 1


def test_training_is_summed_up_in_one_line(tmp_path: Path) -> None:
    from advpipe.stages.train.run import TrainSummary
    from advpipe.stages.train.validate import ClassPrecision

    precision = {"car": ClassPrecision(9, 61.25, 70.0), "truck": ClassPrecision(0, math.nan, math.nan)}
    summary = TrainSummary(Path("run/a.safetensors"), Path("l"), Path("p"), 3, 40, precision)
    assert str(summary) == ("run/a.safetensors: 3 steps on 40 frames; 3D AP on the held-out bag: car 61.2 %")
    assert repr(summary).startswith("<TrainSummary run/a.safetensors: 3 steps")
    assert summary.to_pandas()["boxes"].to_list() == [9, 0]
    assert summary.to_dicts()[0] == {
        "class": "car",
        "boxes": 9,
        "strict_percent": 61.25,
        "loose_percent": 70.0,
    }


def test_the_schema_is_printed_and_written(run: Run, tmp_path: Path) -> None:
    printed = run("schema")
    assert json.loads(printed.stdout)["additionalProperties"] is False
    written, following = run("schema", "-o", "s.json").stdout.splitlines()
    assert written == "schema: s.json"
    assert following.startswith("next: ")
    assert (tmp_path / "s.json").read_text() == printed.stdout


LIMITED = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit_bytes}, {limit_bytes}))
from advpipe.pipeline.cli import app; app()
"""


@pytest.mark.parametrize("limit_bytes", [1000, 300_000])
def test_a_disk_that_fills_up_costs_one_line_and_leaves_nothing(tmp_path: Path, limit_bytes: int) -> None:
    """The kernel refuses files over the limit, as it does on a full disk: the scenario file, then the bag."""
    command = [sys.executable, "-c", LIMITED.format(limit_bytes=limit_bytes), "simulate", "smoke"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert done.returncode == 1
    bag = "" if limit_bytes < 10_000 else "/clean"
    line = f"advpipe: datasets/smoke{bag}: cannot be written: File too large\n"
    assert without_progress(done.stderr) == line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.oracle
def test_what_a_killed_simulation_wrote_is_recovered(run: Run, tmp_path: Path) -> None:
    """SIGKILL in the middle; rosbags reads what was saved, and so does the next stage."""
    from rosbags.highlevel import AnyReader

    command = [sys.executable, "-m", "advpipe", "simulate", "smoke"]
    with subprocess.Popen([*command, "--set", "simulation.duration_s=600"], cwd=tmp_path) as process:
        while sum(file.stat().st_size for file in tmp_path.rglob("*.mcap")) < 2_000_000:
            assert process.poll() is None
            time.sleep(0.02)
        process.kill()
    assert not (tmp_path / "datasets" / "smoke").exists()
    recovered = run("recover", "datasets/smoke")
    assert recovered.returncode == 0, recovered.stderr
    assert "\nrecovered: datasets/smoke-recovered\n" in recovered.stdout
    data_set = tmp_path / "datasets" / "smoke-recovered"
    assert {path.name for path in data_set.iterdir()} == {"clean", "scenario.yaml"}
    with AnyReader([data_set / "clean"]) as reader:
        read = sum(reader.deserialize(cdr, c.msgtype) is not None for c, _, cdr in reader.messages())
    described = json.loads(run("inspect", str(data_set), "--json").stdout)
    assert described["messages"] == read > 100
    assert described["clouds"] > 3
    assert described["provenance"]["scenario_name"] == "smoke"
    assert json.loads(described["provenance"]["recovered"])["clouds"] == described["clouds"]
    arguments = ["attack", "datasets/smoke-recovered", "--recipe", "random", "--frames", "1:3"]
    attacked = run(*arguments)
    assert attacked.returncode == 0, attacked.stderr
    again = run("recover", "datasets/smoke-recovered")
    assert (again.returncode, "nothing to recover" in again.stdout) == (0, True)
