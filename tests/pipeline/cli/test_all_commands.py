"""What holds for every command: its document, how quiet it is, and text from others that stays text.

The data set is hostile: escape sequences in its folder, in the name of a topic and in the provenance.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import COMMANDS, app

ESCAPES = "\x1b]0;owned\x07\u202e"
FOLDER = f"drive {ESCAPES}"
TOPIC = f"/evil{ESCAPES}[/red]"
SHORT = ["--set", "simulation.duration_s=0.3", "--set", "traffic.vehicles=10"]


class Done(NamedTuple):
    code: int
    out: str
    errors: str


Run = Callable[..., Done]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the hostile data set: a drive of three frames, recorded with other names."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.raises(SystemExit) as ended:
        app(["simulate", "smoke", "--out", str(folder / "plain"), *SHORT, "--quiet"])
    assert ended.value.code == 0
    data_set = folder / FOLDER
    data_set.mkdir()
    shutil.copy(folder / "plain" / "scenario.yaml", data_set)
    reader = BagReader(folder / "plain" / "clean")
    provenance = {**reader.provenance, "scenario_name": f"town {ESCAPES} [/red] :smile: $\\frac$"}
    with BagWriter(data_set / "clean", provenance=provenance) as bag:
        for raw in reader.raw_messages():
            bag.copy(raw)
            if raw.topic.name == "/clock":
                bag.copy(replace(raw, topic=replace(raw.topic, name=TOPIC)))
    with pytest.raises(SystemExit):
        app(["share", str(folder / "plain"), "--out", str(folder / "plain.tar"), "--quiet"])
    return folder


@pytest.fixture
def run(
    capfd: pytest.CaptureFixture[str], made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Run:
    monkeypatch.chdir(made)

    def run(*words: str) -> Done:
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            app([word.format(out=tmp_path, drive=FOLDER) for word in words])
        return Done(int(ended.value.code or 0), *capfd.readouterr())

    return run


RESULTS: dict[str, tuple[list[str], str]] = {
    "simulate": (["simulate", "smoke", "-o", "{out}/s\x1b", *SHORT], "frames"),
    "attack": (
        ["attack", "{drive}", "--recipe", "random", "--frames", "0:2", "-o", "{out}/a\x1b"],
        "points_clean",
    ),
    "evaluate": (["evaluate", "{drive}/clean", "--frames", "0:2", "-o", "{out}/e\x1b"], "rows"),
    "export": (["export", "{drive}", "-o", "{out}/x\x1b"], "sent"),
    "run": (["run", "smoke", "-o", "{out}/r\x1b", *SHORT], "evaluation"),
    "train": (["train", "{drive}/clean", "-o", "{out}/t\x1b", "--steps", "1"], "checkpoint"),
    "unpack": (["unpack", "plain.tar", "-o", "{out}/u\x1b"], "folder"),
    "inspect": (["inspect", "{drive}"], "topics"),
    "plot": (["plot", "plain", "-o", "{out}/p\x1b.png"], "picture"),
    "recover": (["recover", "{drive}", "-o", "{out}/c\x1b"], "messages"),
    "verify": (["verify", "{drive}"], "findings"),
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
    "import-weights": ["import-weights", "{drive}/none.pth", "-o", "{out}/i.safetensors"],
    "share": ["share", "{drive}", "-o", "{out}/\x1b"],
    "attack": ["attack", "{drive}", "--type", "explode\x1b\u202e"],
    "inspect": ["inspect", "{drive}/nowhere\x1b"],
    "option": ["inspect", "{drive}", "--lid\x1bar"],
    "command": ["inspekt\x1b"],
}


def refuse_constant(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


def assert_harmless(done: Done) -> None:
    for text in done[1:]:
        assert not set(text) & {"\x1b", "\x07", "\u202e"}, text


def test_every_command_is_here() -> None:
    assert RESULTS.keys() | REFUSED.keys() >= COMMANDS.keys()


GOOD = {"verify": (0, 1)}
"""Exit codes: the hostile copy is not what its labels are of."""

SLOW = ("attack", "evaluate", "run", "train", "sweep")


@pytest.mark.parametrize("command", RESULTS)
def test_results(run: Run, command: str) -> None:
    """For people, spelt out; then for programs, one strict document and nothing else."""
    words, key = RESULTS[command]
    again = ["--overwrite"] if command not in ("unpack", "inspect", "recover", "verify", "clean") else []
    done = run(*words)
    good = GOOD.get(command, (0,))
    assert done.code in good, done.errors
    assert done.out
    assert_harmless(done)
    if command == "unpack":
        words = [*words[:-1], "{out}/again"]
    done = run(*words, *again, "--json")
    assert done.code in good, done.errors
    document = json.loads(done.out, parse_constant=refuse_constant)
    assert key in document
    assert_harmless(done)


@pytest.mark.parametrize(
    "command", [pytest.param(one, marks=[pytest.mark.nightly] if one in SLOW else []) for one in RESULTS]
)
def test_quiet(run: Run, command: str) -> None:
    done = run(*RESULTS[command][0], "--quiet")
    assert (done.code in GOOD.get(command, (0,)), done.out, done.errors) == (True, "", "")


@pytest.mark.parametrize("words", REFUSED.values(), ids=REFUSED.keys())
def test_refusals(run: Run, words: list[str]) -> None:
    done = run(*words)
    assert done.code == 2
    assert done.out == ""
    assert done.errors.count("\n") == 1
    assert "\\x1b" in done.errors
    assert_harmless(done)


def test_verbose_tells_what_is_loaded_seeds_times_and_versions(run: Run) -> None:
    done = run("evaluate", "{drive}/clean", "--frames", "0:2", "-o", "{out}/e", "--seed", "7", "--verbose")
    assert done.code == 0
    for told in (
        "advpipe 0",
        "torch 2",
        "seed 7",
        "opened ",
        "loading detector small",
        "detecting: 2 in",
        "in all: ",
    ):
        assert told in done.errors
    assert_harmless(done)


def test_quiet_and_verbose_contradict(run: Run) -> None:
    assert run("inspect", "{drive}", "-q", "-v").code == 2


def test_a_value_of_100_kb_is_not_echoed_whole(run: Run) -> None:
    long = "x" * 100_000
    for words in (
        ["simulate", "smoke", "--set", f"simulation.{long}=1"],
        ["simulate", "smoke", "--set", f"simulation.seed={long}"],
        ["attack", "{drive}", "--type", long],
        ["attack", "{drive}", "--seed", long],
        ["inspect", long],
        ["evaluate", "{drive}", "--detector", long],
        [long],
    ):
        done = run(*words)
        assert done.code in (1, 2)
        assert 20 < len(done.errors) < 1500
        assert done.errors.count("\n") == 1


def test_a_class_that_ends_the_program_is_no_success(run: Run) -> None:
    for words in (
        ["attack", "{drive}", "--detector", "sys:exit"],
        ["evaluate", "{drive}", "--detector", "os:abc"],
    ):
        done = run(*words, "-o", "{out}/x")
        assert done.code == 2
        assert done.errors.startswith("advpipe: cannot load detector ")
    done = run("attack", "{drive}", "--type", "sys:exit", "-o", "{out}/x")
    assert done.code in (1, 2)
    assert done.errors.count("\n") == 1


def command(words: list[str], folder: Path, out: Path, how: str = "", **environment: str) -> Done:
    """In a process of its own, by a shell: `how` says what becomes of its standard streams."""
    shell = ["bash", "-c", f'set -o pipefail; "$0" -m advpipe "$@" {how}', sys.executable]
    done = subprocess.run(
        [*map(os.fsencode, shell), *(os.fsencode(word.format(out=out, drive=FOLDER)) for word in words)],
        capture_output=True,
        cwd=folder,
        env={**os.environ, **environment},
    )
    return Done(done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace"))


@pytest.mark.parametrize(
    "words",
    [
        ["inspect", "{drive}"],
        pytest.param(["inspect", "{drive}", "--json"], marks=pytest.mark.nightly),
        ["schema"],
    ],
)
def test_standard_output_that_takes_nothing(made: Path, tmp_path: Path, words: list[str]) -> None:
    assert command(words, made, tmp_path, ">&-") == (0, "", "")
    full = command(words, made, tmp_path, ">/dev/full")
    assert full == (1, "", "advpipe: standard output cannot be written: No space left on device\n")
    assert command(words, made, tmp_path, "| head -c 0") in ((1, "", ""), (0, "", ""))


def test_other_streams_that_are_closed(made: Path, tmp_path: Path) -> None:
    for how in ("2>&-", "2>/dev/full", "<&- >&- 2>&-"):
        assert command(["schema", "-o", "{out}/schema", "--overwrite"], made, tmp_path, how).code == 0
        assert json.loads((tmp_path / "schema").read_text(encoding="utf-8"))["properties"]
        assert command(["inspect", "nowhere"], made, tmp_path, how).code == 2


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
ONE_BY_ONE = """
import json, sys
from advpipe.__main__ import main
for words in json.loads(sys.argv[1]):
    sys.argv = ["advpipe", *words]
    try:
        main()
    except SystemExit as end:
        assert not end.code, (words, end.code)
"""
"""Several commands in one process: libraries are loaded once."""


def test_in_a_locale_of_ascii_files_are_the_same(run: Run, made: Path, tmp_path: Path) -> None:
    (tmp_path / "citation.txt").write_text("Å. Author", encoding="utf-8")
    frame = ["--frames", "0:1"]
    commands = (
        ["attack", "plain", "--recipe", "random", *frame, "-o", "{out}/bag"],
        ["evaluate", "plain/clean", *frame, "--no-baseline", "-o", "{out}/report"],
        ["share", "plain", "-o", "{out}/shared", "--citation", str(tmp_path / "citation.txt")],
        ["inspect", "plain"],
    )
    in_ascii, in_utf8 = (
        [[word.replace("{out}", str(tmp_path / name)) for word in words] for words in commands]
        for name in ("ascii", "utf8")
    )
    one_by_one = [sys.executable, "-c", ONE_BY_ONE, json.dumps(in_ascii)]
    ended = subprocess.run(one_by_one, capture_output=True, cwd=made, env={**os.environ, **ASCII})
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.isascii()
    assert ended.stdout.count(b"\n") > len(commands)
    for words in in_utf8:
        done = run(*words)
        assert done.code == 0, done.errors
    for name in ("bag/attack.yaml", "bag/bag_0.mcap", "report/report.html", "shared/README.md"):
        assert (tmp_path / "ascii" / name).read_bytes() == (tmp_path / "utf8" / name).read_bytes(), name
    assert "Å. Author" in (tmp_path / "ascii" / "shared" / "README.md").read_text(encoding="utf-8")
    done = command(["share", "plain", "-o", "{out}/s", "--citation", "Å"], made, tmp_path, **ASCII)
    assert done.code == 2
    assert "set LC_ALL=C.UTF-8" in done.errors


def test_names_that_are_not_utf_8(run: Run, made: Path, tmp_path: Path) -> None:
    """Shown with escapes; refused in one line where a table or report would have to hold them."""
    name = str(tmp_path / os.fsdecode(b"b\xff"))
    shutil.copytree(made / "plain", name)
    for words, code in (
        (["inspect", name], 0),
        (["inspect", name, "--json"], 0),
        (["verify", name], 0),
        (["recover", name], 0),
        (["plot", name, "-o", f"{name}.png"], 0),
        (["export", name, "-o", f"{name}-x"], 0),
        (["simulate", "smoke", "-o", f"{name}-s", *SHORT], 0),
        (["share", name, "-o", "{out}/shared"], 0),
        (["attack", name, "--recipe", "random"], 2),
        (["evaluate", name], 2),
        (["sweep", name], 2),
        (["train", name, "-o", "t"], 2),
        (["run", "smoke", "-o", f"{name}-r"], 2),
        (["inspect", f"{name}/nowhere"], 2),
        (["import-weights", name, "-o", "x.safetensors"], 2),
        (["unpack", f"{name}.tar"], 2),
    ):
        done = run(*words)
        assert done.code == code, (words[0], done.errors)
        lines = [line for line in done.errors.splitlines() if not line.startswith("note: ")]
        assert len(lines) == (0 if code == 0 else 1)
        assert code == 0 or "udcff" in done.errors


FRAME = ["--frames", "0:1"]
BAG = ["attack", "{plain}", "--recipe", "random", *FRAME, "-o", "{out}/bag"]
REPORT = ["evaluate", "{plain}", *FRAME, "--no-baseline", "-o", "{out}/report"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        pytest.param(BAG, 0, marks=pytest.mark.nightly),
        pytest.param(REPORT, 0, marks=pytest.mark.nightly),
        (["simulate", "smoke", "-o", "{out}/drive", *SHORT], 0),
        (["simulate", "smoke", *SHORT], 2),
        pytest.param(["attack"], 2, marks=pytest.mark.nightly),
        (["clean", "--remove"], 2),
        (["plot", "{plain}"], 2),
    ],
)
def test_a_working_folder_that_was_deleted(made: Path, tmp_path: Path, words: list[str], code: int) -> None:
    (tmp_path / "gone").mkdir()
    words = [word.format(plain=made / "plain", out=tmp_path / "out") for word in words]
    shell = ["bash", "-c", 'rmdir ../gone; "$0" -m advpipe "$@"', sys.executable, *words]
    done = subprocess.run(shell, capture_output=True, text=True, cwd=tmp_path / "gone")
    assert done.returncode == code, done.stderr
    if code:
        assert "the working directory was deleted; change to one that exists" in done.stderr
        assert done.stderr.count("\n") == 1
