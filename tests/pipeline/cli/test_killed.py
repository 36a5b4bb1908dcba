"""Commands that are killed, or that meet a full disk, at given moments: what stays, and what comes after."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from forked import Done, Forks
from what_is_left import cleaned, copied, files, hidden

from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.pictures import to_svg

SCENARIO = """
name: tiny
simulation: {seed: 1, duration_s: 0.5, warmup_s: 1}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 30, pedestrians: 0, parked_per_km: 0}
sensors: {lidars: {lidar: {channels: 16, points_per_second: 72000}}}
"""
GRID = """
name: tiny
scenario: tiny.yaml
attacks: {bias: {type: gnss-bias, parameters: {bound_m: 5}}}
"""


@dataclass(frozen=True)
class Case:
    """A command as its user types it. output: what it makes."""

    command: str
    output: str
    has_overwrite: bool = True

    @property
    def arguments(self) -> list[str]:
        return self.command.split()


CHEAP = "--detector sweep_drive:OneVoxel"
"""What it detects is not the point here; the shipped one takes most of the time of an attack."""
RANDOM = f"attack d --recipe random {CHEAP} --workers 1 --out"
CASES = {
    "simulate": Case("simulate tiny.yaml --out d2", "d2"),
    "lidar": Case(f"{RANDOM} d/other", "d/other"),
    "cam": Case("attack d --type cam-speed-constant --attacker 50% --out d/cam", "d/cam"),
    "gnss": Case("attack d --type gnss-bias --out d/gnss", "d/gnss"),
    "evaluate": Case(
        "evaluate d/clean d/adv --frames ::5 --workers 1 --out d/reports/small",
        "d/reports/small",
    ),
    "sweep": Case(
        "sweep d --cells detach-1,detach-1.5 --recipe random --frames ::5 --workers 1 --baseline-tries 1 "
        "--out d/reports/sweep",
        "d/reports/sweep",
    ),
    "grid": Case("grid grid.yaml --workers 1 --out g", "g"),
    "train": Case("train d --steps 1 --out run", "run"),
    "share to a folder": Case("share d --out s", "s"),
    "share to a tar": Case("share d --out s.tar", "s.tar.sha256"),
    "share in parts": Case("share d --split-mb 1 --out s.tar", "s.tar.sha256"),
    "unpack": Case("unpack ready.tar --out u", "u", has_overwrite=False),
    "recover": Case("recover cut.mcap", "cut-recovered"),
    "export": Case("export d --out v", "v"),
    "export to files": Case("export d --format pcd --frames 0:3 --out p", "p"),
    "import files": Case("import files pcd/clean --out i", "i"),
    "import a recording": Case("import rosbag d/clean --frames 0:4 --out i", "i"),
    "plot": Case("plot d --out v2x.png", "v2x.png"),
    "plot of a cloud": Case("plot d --cloud 0 --out cloud.png", "cloud.png"),
    "figures": Case("figures r --out r-pdf", "r-pdf"),
    "schema": Case("schema --out scenario.schema.json", "scenario.schema.json"),
}
IN_DATA_SET = ("lidar", "cam", "gnss", "evaluate", "sweep")
"""Cases whose output is a part of `d`: what a kill leaves there is in the way of nobody who shares it."""

NIGHTLY = pytest.mark.nightly
EVERY_TIME = ("simulate", "lidar", "import files", "share in parts")
"""Killed in every run of the tests: a job, two that go on where they stopped, files beside each other."""


def chosen(names: Iterable[str]) -> list[Any]:
    """The other commands are killed at night."""
    return [name if name in EVERY_TIME else pytest.param(name, marks=NIGHTLY) for name in names]


@pytest.fixture(scope="module")
def ready(forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set with an attack, its archive, its clouds as files, a truncated recording, and a figure."""
    folder = tmp_path_factory.mktemp("ready")
    (folder / "tiny.yaml").write_text(SCENARIO)
    (folder / "grid.yaml").write_text(GRID)
    commands = (
        *("simulate tiny.yaml --out d", f"{RANDOM} d/adv --frames ::5", "share d --out ready.tar"),
        "export d --format pcd --frames 0:4 --out pcd",
    )
    for command in commands:
        done = forks.run(folder, *command.split())
        assert done.code == 0, done.error
    whole = (folder / "d" / "clean" / "clean_0.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[:-2000])
    (folder / "r" / "figures").mkdir(parents=True)
    (folder / "r" / "report.json").write_text("{}")
    figure = Figure()
    figure.add_subplot().plot([place**3 % 997 for place in range(4000)])  # more than fits on a full disk
    (folder / "r" / "figures" / "one.svg").write_bytes(to_svg(figure))
    return folder


@dataclass(frozen=True)
class Undisturbed:
    """What a command does that nobody kills. sizes: of the files that it adds, in bytes."""

    folder: Path
    moments: tuple[str, ...]
    expected: dict[str, str]
    sizes: tuple[int, ...]


Alone = Callable[[str], Undisturbed]


@pytest.fixture(scope="module")
def alone(forks: Forks, ready: Path, tmp_path_factory: pytest.TempPathFactory) -> Alone:
    """Runs a case in a copy of what is ready, each once only."""
    before = files(ready).keys()

    @cache
    def run(name: str) -> Undisturbed:
        folder = copied(ready, tmp_path_factory.mktemp("alone") / "work")
        done = forks.run(folder, *CASES[name].arguments)
        assert done.code == 0, done.error
        assert not hidden(folder)
        expected = files(folder)
        sizes = tuple((folder / path).stat().st_size for path in expected.keys() - before)
        return Undisturbed(folder, done.moments, expected, sizes)

    return run


def moments_of(names: tuple[str, ...], every: bool) -> list[int]:
    """All moments, or just before the output gets its last name."""
    if every:
        return list(range(0, len(names), max(1, len(names) // 60)))
    return [place for place, name in enumerate(names) if name == "os.rename"][-1:]


def check(
    forks: Forks, ready: Path, folder: Path, name: str, alone: Alone, every: bool, by: int = signal.SIGKILL
) -> None:
    case, expected = CASES[name], alone(name).expected
    for number, moment in enumerate(moments_of(alone(name).moments, every)):
        killed = forks.run(copied(ready, folder), *case.arguments, kill_at=moment, by=by)
        assert killed.code in (-by, 128 + by), (moment, killed.error)
        for found in cleaned(forks, folder):
            assert not found["running"], found
        if number == 0 and name in (IN_DATA_SET if every else IN_DATA_SET[:1]):
            for command in ("share d --out shared", "verify d"):
                done = forks.run(folder, *command.split())
                assert done.code == 0, (moment, command, done.out, done.error)
            shutil.rmtree(folder / "shared")
        ways = [[], ["--overwrite"]] if case.has_overwrite else [[]]
        for overwrite in ways if every else ways[number % len(ways) :][:1]:
            again = forks.run(folder, *case.arguments, *overwrite)
            is_done = again.code == 0 or (not overwrite and "already exists" in again.error)
            assert is_done, (moment, again.error)
        cleaned(forks, folder, "--remove", "--all")
        assert files(folder) == expected, moment
        assert not hidden(folder)


@pytest.mark.parametrize("name", chosen(CASES))
def test_a_killed_command_is_run_again(
    forks: Forks, ready: Path, tmp_path: Path, alone: Alone, name: str
) -> None:
    check(forks, ready, tmp_path / "work", name, alone, every=False)


@NIGHTLY
@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("name", CASES)
def test_a_command_that_is_killed_anywhere(
    forks: Forks, ready: Path, tmp_path: Path, alone: Alone, name: str, by: int
) -> None:
    check(forks, ready, tmp_path / "work", name, alone, every=True, by=by)


REPLACED = ["lidar", "share in parts"]
"""A bag, and files beside each other; the others are replaced by the same code."""


@pytest.mark.parametrize(
    "name",
    [*REPLACED, *(pytest.param(name, marks=NIGHTLY) for name in ("simulate", "evaluate", "export"))],
)
def test_an_output_that_was_being_replaced(forks: Forks, tmp_path: Path, alone: Alone, name: str) -> None:
    """Killed between any two of the last names that an output gets, and run again without --overwrite."""
    case, folder, expected = CASES[name], alone(name).folder, alone(name).expected
    whole = forks.run(copied(folder, tmp_path / "work"), *case.arguments, "--overwrite")
    names = [place for place, each in enumerate(whole.moments) if each == "os.rename"][-4:]
    for moment in names:
        work = copied(folder, tmp_path / "work")
        assert forks.run(work, *case.arguments, "--overwrite", kill_at=moment).code == -signal.SIGKILL
        again = forks.run(work, *case.arguments)
        assert again.code == 0 or "already exists" in again.error, (moment, again.error)
        cleaned(forks, work, "--remove", "--all")
        assert files(work) == expected, moment
        assert not hidden(work)


@NIGHTLY  # test_sweep.py loses a finished cell, too, of a drive whose sweep takes seconds
def test_a_sweep_that_was_stopped_is_the_same_to_the_byte(
    forks: Forks, ready: Path, tmp_path: Path, alone: Alone
) -> None:
    """Killed when its first cell is done; only times.json tells."""
    case, whole = CASES["sweep"], alone("sweep").folder
    names = [place for place, name in enumerate(alone("sweep").moments) if name == "os.rename"]
    parts = copied(ready, tmp_path / "parts")
    for moment in names:
        assert forks.run(parts, *case.arguments, kill_at=moment).code == -signal.SIGKILL
        if list((parts / "d/reports/sweep/cells").glob("*.json")):
            break
    again = forks.run(parts, *case.arguments)
    assert again.code == 0, again.error
    assert "kept" in again.out
    assert files(parts) == files(whole)
    for folder in (whole, parts):
        times = json.loads((folder / "d/reports/sweep/times.json").read_text())
        assert set(times) == {"random-detach-1", "random-detach-1.5"}
        assert set(times["random-detach-1"]) == {"attack_s", "evaluate_s"}


def refused(done: Done) -> None:
    """One line that names the disk's refusal."""
    assert done.code == 1, (done.code, done.out, done.error)
    (line,) = [each for each in done.error.splitlines() if each.startswith("advpipe:")]
    assert "Traceback" not in done.error
    reasons = ("File too large", "No space left on device", "bytes are needed")
    assert any(reason in line for reason in reasons)


def left_by_a_full_disk(forks: Forks, folder: Path, before: dict[str, str], case: Case) -> None:
    """Outputs from before, and what the command goes on from: a job, a training run, cells of a sweep."""
    for found in cleaned(forks, folder):
        assert found["use"] == "resume", found
    after = {name: digest for name, digest in files(folder).items() if ".job/" not in name}
    if case.output in ("run", "d/reports/sweep", "g"):
        after = {name: digest for name, digest in after.items() if not name.startswith(case.output)}
        assert not any(path.name.startswith(".") for path in (folder / case.output).glob("*"))
    assert after == before


PICTURES_AND_TEXTS = ("plot", "plot of a cloud", "schema")


@pytest.mark.parametrize("share_of_largest", [0.02, pytest.param(0.6, marks=NIGHTLY)])
@pytest.mark.parametrize("name", chosen(name for name in CASES if name not in PICTURES_AND_TEXTS))
def test_files_that_may_not_grow(
    forks: Forks, ready: Path, tmp_path: Path, alone: Alone, name: str, share_of_largest: float
) -> None:
    """RLIMIT_FSIZE stands for a full disk where nobody may mount one."""
    case, most_bytes = CASES[name], int(max(alone(name).sizes) * share_of_largest)
    folder = copied(ready, tmp_path / "work")
    before = files(folder)
    refused(forks.run(folder, *case.arguments, most_bytes=most_bytes))
    left_by_a_full_disk(forks, folder, before, case)


@contextmanager
def small_disk(place: Path, size_bytes: int) -> Iterator[Path]:
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", str(place)]
    if os.geteuid() or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("only root may mount a file system")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


@NIGHTLY
@pytest.mark.parametrize("room", [0, 0.1, 0.6])
@pytest.mark.parametrize("name", CASES)
def test_a_full_disk(forks: Forks, ready: Path, tmp_path: Path, name: str, room: float) -> None:
    """room: free, as a share of what the command writes. With more room, the same command goes on."""
    case = CASES[name]
    whole = copied(ready, tmp_path / "whole")
    before = files(whole)
    assert forks.run(whole, *case.arguments).code == 0
    expected = files(whole)
    size = sum((whole / path).stat().st_size for path in expected.keys() - before.keys())
    with small_disk(tmp_path / "disk", 200_000_000) as disk:
        folder = copied(ready, disk / "work")
        free = shutil.disk_usage(disk).free
        with (disk / "filler").open("wb") as filler:
            os.posix_fallocate(filler.fileno(), 0, max(4096, free - int(size * room) - 8192))
        refused(forks.run(folder, *case.arguments))
        left_by_a_full_disk(forks, folder, before, case)
        (disk / "filler").unlink()
        again = forks.run(folder, *case.arguments)
        assert again.code == 0, again.error
        assert files(folder) == expected
