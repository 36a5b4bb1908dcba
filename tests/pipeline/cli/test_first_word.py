"""The first word of each command comes before a library is loaded that takes time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from advpipe.pipeline.cli import COMMANDS

HEAVY = ("torch", "open3d", "libsumo", "rosbags", "matplotlib", "rich", "scipy", "shapely", "pyarrow")

FIRST_WORDS = {
    "demo": (["-o", "d", "--no-browser"], "attacking and evaluating a sample ..."),
    "simulate": (["smoke"], "simulating smoke ..."),
    "attack": ([], "attacking the newest data set with detach ..."),
    "attack by outsiders": (
        ["--type=cam-drop", "--credentials", "none"],
        "attacking the newest data set with cam-drop ...",
    ),
    "attack with a parameter": (["--ratio", "1%", "--type=detach"], "reading about detach ..."),
    "evaluate": (["clean", "a", "b"], "evaluating clean and 2 more ..."),
    "figures": (["r"], "copying the figures of r ..."),
    "attacks": ([], "listing the attacks ..."),
    "sweep": (["d"], "sweeping d ..."),
    "grid": (["g.yaml"], "running the grid g.yaml ..."),
    "import": (["kitti", "k", "-o", "d"], "importing k as kitti ..."),
    "export": (["d"], "exporting d as veremi ..."),
    "run": (["smoke"], "running smoke ..."),
    "train": (["d", "-o", "o"], "training a detector on d ..."),
    "train-camera": (["d", "-o", "o"], "training an image detector on d ..."),
    "import-weights": (["w.pth", "-o", "w.safetensors"], "importing w.pth ..."),
    "share": (["d"], "sharing d ..."),
    "unpack": (["d.tar"], "unpacking d.tar ..."),
    "plot": (["d"], "drawing d ..."),
    "view": (["d"], "viewing d ..."),
    "play": (["d", "--ros2"], "playing d ..."),
    "relay": (["--attack", "d", "--ros2", "--domain", "9"], "relaying by d ..."),
    "recover": (["d"], "recovering d ..."),
    "verify": (["d"], "verifying d ..."),
    "audit": (["d"], "auditing d ..."),
    "investigate": (["d"], "investigating d ..."),
    "check": (["carla"], "checking carla ..."),
}

QUICK = {"inspect", "clean", "schema"}
"""Usually done before anybody wonders: they say what they do only if they are not."""

CHILD = f"""
import json, os, sys
from advpipe.pipeline.cli import app

class FirstWord:
    def __getattr__(self, name):
        return getattr(sys.__stderr__, name)
    def write(self, text):
        loaded = [name for name in {HEAVY!r} if name in sys.modules]
        os.write(1, (json.dumps([text, loaded]) + chr(10)).encode())
        os._exit(0)

for arguments in json.loads(sys.argv[1]):
    if (child := os.fork()) == 0:
        sys.stderr = FirstWord()
        app(arguments, prog_name="advpipe")
    os.waitpid(child, 0)
"""


def test_every_command_is_here() -> None:
    assert {name.split()[0] for name in FIRST_WORDS} | QUICK == COMMANDS.keys()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_the_first_word_comes_before_libraries(tmp_path: Path) -> None:
    commands = [[name.split()[0], *more] for name, (more, _) in FIRST_WORDS.items()]
    done = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(commands)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert found == [[f"{words}\n", []] for _, words in FIRST_WORDS.values()]
