"""Whole commands in a process of their own: options and names, on a good data set and on changed ones."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

from hypothesis import strategies as st

from advpipe.pipeline.core.errors import one_line
from tests.first_words import without_progress
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Fault, Target, Unhandled
from tests.fuzz.judge import LONGEST_LINE
from tests.fuzz.targets import embedded_text
from tests.fuzz.values import NUMBERS, TEXTS, YAML_RAWS

ARGUMENTS = "arguments.json"
EXIT_CODES = (0, 1, 2, 130)
LAST_RESORT = re.compile(r"Traceback \(most recent call last\)|report (it|this)|please report", re.IGNORECASE)
COMMANDS = (
    *(
        "simulate",
        "attack",
        "evaluate",
        "sweep",
        "grid",
        "export",
        "run",
        "train",
        "train-camera",
        "import-weights",
        "share",
        "unpack",
    ),
    *("figures", "inspect", "plot", "recover", "verify", "audit", "schema", "attacks", "clean", "check"),
)
PINNED = re.compile(r"duration_s|^--steps|^--cells")
"""Words that stay: without them, a command rightly takes minutes."""

GOOD = {
    "simulate": ["smoke", "--set", "simulation.duration_s=0.1", "--out", "new"],
    "attack": ["drive", "--type", "cam-position-offset", "--out", "new"],
    "export": ["drive/cam", "--out", "new"],
    "inspect": ["drive/clean"],
    "verify": ["drive"],
    "audit": ["drive"],
    "plot": ["drive", "--out", "new.png"],
    "attacks": ["detach"],
    "clean": ["drive"],
    "figures": ["report", "--out", "new"],
    "recover": ["drive/clean/clean_0.mcap"],
    "unpack": ["archives/town.tar", "--out", "new"],
    "share": ["drive", "--out", "new"],
    "import-weights": ["weights/second.pth", "--out", "new.safetensors"],
    "evaluate": ["drive/clean", "drive/cam", "--out", "new"],
    "train": ["drive/clean", "--out", "new", "--steps=1"],
    "train-camera": ["drive/clean", "--out", "new", "--steps=1"],
    "grid": ["grid.yaml", "--out", "new"],
    "sweep": ["drive", "--out", "new", "--cells=none"],
    "run": ["smoke", "--set", "simulation.duration_s=0.1", "--out", "new"],
    "schema": [],
    "check": ["carla", "--server", "127.0.0.1:9"],
}
OPTIONS = (
    *(
        "--out",
        "--set",
        "--type",
        "--ratio",
        "--eps-cm",
        "--points",
        "--frames",
        "--attacker",
        "--victim",
        "--from",
    ),
    *(
        "--to",
        "--lidar",
        "--detector",
        "--device",
        "--seed",
        "--workers",
        "--recipe",
        "--goal",
        "--format",
        "--key",
    ),
    *(
        "--json",
        "--quick",
        "--overwrite",
        "--defence",
        "--defence-frames",
        "--detect-attacks",
        "--baseline-tries",
        "--steps",
        "--learning-rate",
        "--preset",
    ),
    *(
        "--validate",
        "--start",
        "--cells",
        "--table",
        "--check",
        "--split",
        "--licence",
        "--sign",
        "--credentials",
        "--traceback",
    ),
    *("--cloud", "--attacked", "--remove", "--all"),
    *("-q", "-v", "--help", "--version", "--nonsense"),
)


def command(tree: Path, out: Path) -> None:
    """Runs the command of a case in its tree; Unhandled for an end that no user should see."""
    arguments = json.loads((tree / ARGUMENTS).read_text(encoding="utf-8"))
    _run(arguments, tree)


def on_changed(tree: Path, out: Path) -> None:
    """`inspect`, on the data set of a case."""
    _run(["inspect", "drive/clean"], tree)


def _run(arguments: list[str], tree: Path) -> None:
    encoded = [os.fsencode(argument.encode("utf-8", "surrogateescape")) for argument in arguments]
    done = subprocess.run(
        [os.fsencode(sys.executable), b"-m", b"advpipe", *encoded],
        cwd=tree,
        env={**os.environ, "OMP_NUM_THREADS": "1", "COLUMNS": "80"},
        capture_output=True,
        stdin=subprocess.DEVNULL,
    )
    errors = done.stderr.decode(errors="backslashreplace")
    fault = fault_of(done.returncode, done.stdout.decode(errors="backslashreplace"), errors)
    if fault is not None:
        raise Unhandled(fault)


def fault_of(code: int, output: str, errors: str) -> Fault | None:
    """What is wrong with the end of a command, if anything."""
    if LAST_RESORT.search(errors):
        what, where = last_error(errors)
        return Fault("exception", what, where, errors)
    if code not in EXIT_CODES:
        return Fault("exit", f"exit code {code}", trace=errors)
    for text in (output, errors):
        bad = next((sign for sign in text if not sign.isprintable() and sign not in "\n\r"), None)
        if bad is not None:
            return Fault("terminal", f"{bad!a} reaches the terminal", trace=text)
    lines = [line for line in without_progress(errors).splitlines() if line.strip()]
    if code == 1 and len(lines) > 1:
        return Fault("line", f"{len(lines)} lines on standard error", lines[0][:60], trace=errors)
    if code == 1 and lines and len(lines[0]) > LONGEST_LINE:
        return Fault("line", f"an error of {len(lines[0])} characters", lines[0][:60], trace=errors)
    return None


def last_error(text: str) -> tuple[str, str]:
    """The error in a traceback, and the innermost place in advpipe."""
    places = re.findall(r'File "[^"]*?/((?:pipeline|stages)/[^"]+)", line (\d+), in (\w+)', text)
    path, line, name = places[-1] if places else ("?", "?", "?")
    return one_line(text.strip().splitlines()[-1])[:200], f"{path}:{line} {name}"


CALLS: dict[str, Call] = {"command": command, "inspect": on_changed}


@st.composite
def argument_cases(draw: st.DrawFn) -> Case:
    """A good command with words changed."""
    name = draw(st.sampled_from(COMMANDS))
    arguments = [name, *GOOD[name]]
    texts = [text.replace("\0", "").replace("\ud800", "\udcff") for text in TEXTS[:-1]]
    values = st.one_of(
        st.sampled_from(texts),
        st.sampled_from(NUMBERS).map(str),
        st.sampled_from(YAML_RAWS).map(lambda raw: raw.text),
    )
    for _ in range(draw(st.integers(1, 3))):
        edit = draw(st.sampled_from(["value", "option", "option", "drop", "word"]))
        place = draw(st.integers(1, len(arguments)))
        value = draw(values).replace("\0", "")[:100_000]
        if edit == "option":
            arguments += [draw(st.sampled_from(OPTIONS)), *([value] if draw(st.booleans()) else [])]
        elif place < len(arguments) and PINNED.search(arguments[place]):
            continue
        elif edit == "drop":
            del arguments[place : place + 1]
        elif edit == "word":
            arguments.insert(place, value)
        elif place < len(arguments):
            key, equals, _ = arguments[place].partition("=")
            arguments[place] = f"{key}={value}" if equals else value
    return Case("command", ARGUMENTS, json.dumps(arguments).encode(), " ".join(arguments)[:200])


def cases(folder: Path) -> st.SearchStrategy[Case]:
    changed = embedded_text.cases(folder / base.DRIVE).map(
        lambda case: Case("inspect", f"{base.DRIVE}/{case.place}", case.data, case.note)
    )
    return st.one_of(argument_cases(), argument_cases(), argument_cases(), changed)


TARGET = Target("command_line", "", cases, CALLS, smoke_inputs=3)
