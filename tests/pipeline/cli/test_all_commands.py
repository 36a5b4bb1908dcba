"""What holds for every command: its document, how quiet it is, and text from others that stays text."""

from __future__ import annotations

import json

import pytest
from hostile_set import SHORT, Done, Run

from advpipe.pipeline.cli import COMMANDS

RESULTS: dict[str, tuple[list[str], str]] = {
    "simulate": (["simulate", "smoke", "-o", "{out}/s\x1b", *SHORT], "frames"),
    "attack": (
        ["attack", "{drive}", "--recipe", "random", "--frames", "0:2", "-o", "{out}/a\x1b"],
        "points_clean",
    ),
    "attacks": (["attacks"], "attacks"),
    "evaluate": (["evaluate", "{drive}/clean", "--frames", "0:2", "-o", "{out}/e\x1b"], "rows"),
    "export": (["export", "{drive}", "-o", "{out}/x\x1b"], "sent"),
    "run": (["run", "smoke", "-o", "{out}/r\x1b", *SHORT], "evaluation"),
    "train": (["train", "{drive}/clean", "-o", "{out}/t\x1b", "--steps", "1"], "checkpoint"),
    "unpack": (["unpack", "plain.tar", "-o", "{out}/u\x1b"], "folder"),
    "inspect": (["inspect", "{drive}"], "topics"),
    "plot": (["plot", "plain", "-o", "{out}/p\x1b.png"], "picture"),
    "recover": (["recover", "{drive}", "-o", "{out}/c\x1b"], "messages"),
    "verify": (["verify", "{drive}"], "findings"),
    "investigate": (["investigate", "{drive}"], "suspects"),
    "share": (["share", "plain", "-o", "{out}/shared"], "files"),
    "clean": (["clean", "{drive}"], "leftovers"),
    "schema": (["schema", "-o", "{out}/schema\x1b"], "schema"),
    "sweep": (
        [
            "sweep",
            "{drive}/clean",
            "--cells",
            "detach-1",
            "--recipe",
            "random",
            "--frames",
            "0:1",
            "-o",
            "{out}/w\x1b",
        ],
        "cells",
    ),
}
REFUSED = {
    "audit": ["audit", "{drive}"],  # without an attack
    "grid": ["grid", "{drive}/nowhere\x1b.yaml"],
    "train-camera": ["train-camera", "{drive}/clean", "-o", "{out}/t\x1b"],  # without a camera
    "import": ["import", "kitti", "{drive}/nowhere\x1b", "-o", "{out}/i\x1b"],
    "demo": ["demo", "--no-browser", "-o", "{drive}"],
    "import-weights": ["import-weights", "{drive}/none.pth", "-o", "{out}/i.safetensors"],
    "share": ["share", "{drive}", "-o", "{out}/\x1b"],
    "view": ["view", "{drive}/nowhere\x1b"],
    "play": ["play", "{drive}/nowhere\x1b", "--ros2"],
    "relay": ["relay", "--attack", "{drive}/nowhere\x1b", "--ros2", "--domain", "9", "-o", "{out}/l"],
    "figures": ["figures", "{drive}/nowhere\x1b"],
    "check": ["check", "carla\x1b"],
    "attack": ["attack", "{drive}", "--type", "explode\x1b\u202e"],
    "inspect": ["inspect", "{drive}/nowhere\x1b"],
    "option": ["inspect", "{drive}", "--lid\x1bar"],
    "command": ["inspekt\x1b"],
}


def refuse_constant(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def assert_harmless(done: Done) -> None:
    for text in done[1:]:
        assert not set(text) & {"\x1b", "\x07", "\u202e"}, text


def test_every_command_is_here() -> None:
    assert RESULTS.keys() | REFUSED.keys() >= COMMANDS.keys()


GOOD = {"verify": (0, 1), "investigate": (0, 1)}
"""Exit codes: the hostile copy is not what its labels are of."""

SLOW = ("attack", "evaluate", "run", "train", "sweep")


BY_NIGHT = [pytest.param(one, marks=[pytest.mark.nightly] if one in SLOW else []) for one in RESULTS]


@pytest.mark.parametrize("command", BY_NIGHT)
def test_results_for_people(run: Run, command: str) -> None:
    """Spelt out."""
    done = run(*RESULTS[command][0])
    assert done.code in GOOD.get(command, (0,)), done.errors
    assert done.out
    assert_harmless(done)


@pytest.mark.parametrize("command", RESULTS)
def test_results_for_programs(run: Run, command: str) -> None:
    """One strict document and nothing else."""
    arguments, key = RESULTS[command]
    done = run(*arguments, "--json")
    assert done.code in GOOD.get(command, (0,)), done.errors
    document = json.loads(done.out, parse_constant=refuse_constant)
    assert key in document
    assert_harmless(done)


@pytest.mark.parametrize("command", BY_NIGHT)
def test_quiet(run: Run, command: str) -> None:
    done = run(*RESULTS[command][0], "--quiet")
    assert (done.code in GOOD.get(command, (0,)), done.out, done.errors) == (True, "", "")


@pytest.mark.parametrize("arguments", REFUSED.values(), ids=REFUSED.keys())
def test_refusals(run: Run, arguments: list[str]) -> None:
    done = run(*arguments)
    assert done.code == 2
    assert done.out == ""
    assert done.errors.count("\n") == 1
    assert "\\x1b" in done.errors
    assert_harmless(done)


def test_verbose_prints_what_is_loaded_seeds_times_and_versions(run: Run) -> None:
    done = run("evaluate", "{drive}/clean", "--frames", "0:2", "-o", "{out}/e", "--seed", "7", "--verbose")
    assert done.code == 0
    for line in (
        "advpipe 0",
        "torch 2",
        "seed 7",
        "opened ",
        "loading detector small",
        "detecting: 2 in",
        "in all: ",
    ):
        assert line in done.errors
    assert_harmless(done)


def test_quiet_and_verbose_contradict(run: Run) -> None:
    assert run("inspect", "{drive}", "-q", "-v").code == 2


def test_a_value_of_100_kb_is_not_echoed_whole(run: Run) -> None:
    long = "x" * 100_000
    for arguments in (
        ["simulate", "smoke", "--set", f"simulation.{long}=1"],
        ["simulate", "smoke", "--set", f"simulation.seed={long}"],
        ["attack", "{drive}", "--type", long],
        ["attack", "{drive}", "--seed", long],
        ["attack", "{drive}", "--type", "cam-drop", "--credentials", long],
        ["inspect", long],
        ["evaluate", "{drive}", "--detector", long],
        [long],
    ):
        done = run(*arguments)
        assert done.code in (1, 2)
        assert 20 < len(done.errors) < 1500
        assert done.errors.count("\n") == 1


def test_a_class_that_ends_the_program_is_no_success(run: Run) -> None:
    for arguments in (
        ["attack", "{drive}", "--detector", "sys:exit"],
        ["evaluate", "{drive}", "--detector", "os:abc"],
    ):
        done = run(*arguments, "-o", "{out}/x")
        assert done.code == 2
        assert done.errors.startswith("advpipe: cannot load detector ")
    done = run("attack", "{drive}", "--type", "sys:exit", "-o", "{out}/x")
    assert done.code in (1, 2)
    assert done.errors.count("\n") == 1
