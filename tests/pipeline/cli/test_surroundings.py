"""Commands in unusual surroundings: closed streams, other locales, odd file names, a folder that is gone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from first_words import without_progress
from hostile_set import FOLDER, SHORT, Done, Run


def command(arguments: list[str], folder: Path, out: Path, how: str = "", **environment: str) -> Done:
    """In a process of its own, by a shell: `how` says what becomes of its standard streams."""
    shell = ["bash", "-c", f'set -o pipefail; "$0" -m advpipe "$@" {how}', sys.executable]
    done = subprocess.run(
        [
            *map(os.fsencode, shell),
            *(os.fsencode(argument.format(out=out, drive=FOLDER)) for argument in arguments),
        ],
        capture_output=True,
        cwd=folder,
        env={**os.environ, **environment},
    )
    out, errors = (text.decode(errors="replace") for text in (done.stdout, done.stderr))
    return Done(done.returncode, out, without_progress(errors))


@pytest.mark.parametrize(
    "arguments",
    [
        ["inspect", "{drive}"],
        pytest.param(["inspect", "{drive}", "--json"], marks=pytest.mark.nightly),
        ["schema"],
    ],
)
def test_standard_output_that_takes_nothing(made: Path, tmp_path: Path, arguments: list[str]) -> None:
    assert command(arguments, made, tmp_path, ">&-") == (0, "", "")
    full = command(arguments, made, tmp_path, ">/dev/full")
    assert full == (1, "", "advpipe: standard output cannot be written: No space left on device\n")
    assert command(arguments, made, tmp_path, "| head -c 0") in ((1, "", ""), (0, "", ""))


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


@pytest.mark.nightly
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
        [
            [argument.replace("{out}", str(tmp_path / name)) for argument in arguments]
            for arguments in commands
        ]
        for name in ("ascii", "utf8")
    )
    one_by_one = [sys.executable, "-c", ONE_BY_ONE, json.dumps(in_ascii)]
    ended = subprocess.run(one_by_one, capture_output=True, cwd=made, env={**os.environ, **ASCII})
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.isascii()
    assert ended.stdout.count(b"\n") > len(commands)
    for arguments in in_utf8:
        done = run(*arguments)
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
    for arguments, code in (
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
        done = run(*arguments)
        assert done.code == code, (arguments[0], done.errors)
        lines = [line for line in done.errors.splitlines() if not line.startswith("note: ")]
        assert len(lines) == (0 if code == 0 else 1)
        assert code == 0 or "udcff" in done.errors


FRAME = ["--frames", "0:1"]
BAG = ["attack", "{plain}", "--recipe", "random", *FRAME, "-o", "{out}/bag"]
REPORT = ["evaluate", "{plain}", *FRAME, "--no-baseline", "-o", "{out}/report"]


@pytest.mark.parametrize(
    ("arguments", "code"),
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
def test_a_working_folder_that_was_deleted(
    made: Path, tmp_path: Path, arguments: list[str], code: int
) -> None:
    (tmp_path / "gone").mkdir()
    arguments = [argument.format(plain=made / "plain", out=tmp_path / "out") for argument in arguments]
    shell = ["bash", "-c", 'rmdir ../gone; "$0" -m advpipe "$@"', sys.executable, *arguments]
    done = subprocess.run(shell, capture_output=True, text=True, cwd=tmp_path / "gone")
    assert done.returncode == code, done.stderr
    if code:
        assert "the working directory was deleted; change to one that exists" in done.stderr
        assert without_progress(done.stderr).count("\n") == 1
