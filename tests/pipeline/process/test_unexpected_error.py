"""Unexpected errors: one line, a file with the traceback, and a failure in tests."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from first_words import without_progress

FAULTS = {
    "RuntimeError": "raise RuntimeError('no\\nidea \\x1b[2J')",
    "RecursionError": "fault()",
    "MemoryError": "bytearray(1 << 62)",
    "ZeroDivisionError": "1 / 0",
}


def inspect(fault: str, folder: Path, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command where reading a bag has a mistake of ours."""
    code = (
        "import advpipe.pipeline.bag.inspect as module\n"
        f"def fault(*_):\n    {fault}\n"
        "module.describe = fault\n"
        "from advpipe.__main__ import main; main()"
    )
    (folder / "some").mkdir(exist_ok=True)
    (folder / "some" / "metadata.yaml").touch()
    arguments = [*options, "inspect", "some"]
    environment = {**os.environ, "ADVPIPE_TRACEBACK_DIR": str(folder), **environment}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment)
    done.stderr = without_progress(done.stderr)
    return done


@pytest.mark.parametrize("kind", FAULTS)
def test_an_unexpected_error_gives_one_line_and_a_file(tmp_path: Path, kind: str) -> None:
    done = inspect(FAULTS[kind], tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"advpipe: unexpected {kind}")
    assert done.stderr.count("\n") == 1
    assert "please report it" in done.stderr
    assert "\x1b" not in done.stderr
    (file,) = tmp_path.glob("advpipe-error-*.txt")
    assert str(file) in done.stderr
    text = file.read_text(encoding="utf-8")
    for part in ("advpipe: 0", "Python: 3", "platform: ", "inspect some", "Traceback (most recent", kind):
        assert part in text
    inspect(FAULTS[kind], tmp_path)
    assert file.read_text(encoding="utf-8") == text
    assert len(list(tmp_path.glob("advpipe-error-*.txt"))) == 2


@pytest.mark.parametrize(("options", "value"), [(["--traceback"], "0"), ([], "1")])
def test_the_traceback_is_shown_on_request(tmp_path: Path, options: list[str], value: str) -> None:
    done = inspect(FAULTS["ZeroDivisionError"], tmp_path, *options, ADVPIPE_TRACEBACK=value)
    assert done.stderr.startswith("Traceback (most recent call last)")
    assert done.stderr.splitlines()[-1].startswith("advpipe: unexpected ZeroDivisionError")


def test_the_traceback_is_shown_if_the_file_cannot_be_written(tmp_path: Path) -> None:
    done = inspect(FAULTS["ZeroDivisionError"], tmp_path, ADVPIPE_TRACEBACK_DIR=str(tmp_path / "nowhere"))
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback (most recent call last)")
    assert "cannot be saved to a file: No such file or directory" in done.stderr.splitlines()[-1]


def test_a_usage_error_shows_no_traceback(tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "advpipe", "--traceback", "inspect", "nowhere"]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, without_progress(done.stderr).count("\n")) == (2, 1)


TEST = """
import subprocess, sys

def test_that_expects_a_failure():
    code = "import advpipe.pipeline.bag.inspect as m; m.describe = lambda *_: 1 / 0;" \\
        "from advpipe.pipeline.cli import app; app(['inspect', 'some'])"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 1
"""


def test_in_tests_it_is_a_failure(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).parents[2] / "conftest.py", tmp_path)
    (tmp_path / "test_it.py").write_text(TEST)
    (tmp_path / "some").mkdir()
    (tmp_path / "some" / "metadata.yaml").touch()
    # With a folder of its own for temporary files: it would empty those of earlier runs, for a minute.
    own = f"--basetemp={tmp_path / 'temporary'}"
    arguments = ["-m", "pytest", "-p", "no:dash", "-p", "no:cacheprovider", own]
    done = subprocess.run([sys.executable, *arguments], cwd=tmp_path, capture_output=True, text=True)
    assert "an unexpected error" in done.stdout
    assert "ZeroDivisionError" in done.stdout
    assert "1 passed, 1 error" in done.stdout
