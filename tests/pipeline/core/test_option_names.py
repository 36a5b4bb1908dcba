"""Options by the names of the command line and of Python."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from first_words import without_progress

import advpipe
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.core.jobs import run_jobs
from advpipe.pipeline.core.option_names import option_name, use_flags


@pytest.mark.parametrize(
    ("name", "value", "flag", "argument"),
    [
        ("overwrite", True, "--overwrite", "overwrite=True"),
        ("out", None, "--out", "out"),
        ("learning_rate", 0.1, "--learning-rate 0.1", "learning_rate=0.1"),
        ("settings", None, "--set", "settings"),
        ("device", "cpu", "--device cpu", "device='cpu'"),
    ],
)
def test_flags_and_arguments(name: str, value: object, flag: str, argument: str) -> None:
    assert option_name(name, value) == argument
    with use_flags():
        assert option_name(name, value) == flag
    assert option_name(name, value) == argument


def refusal() -> Callable[[int], None]:
    def refuse(job: int) -> None:
        raise OutputExistsError(f"output {job}")

    return refuse


def test_workers_name_them_like_their_parent() -> None:
    with use_flags(), pytest.raises(AdvpipeError, match="already exists; pass --overwrite to replace"):
        run_jobs(refusal, range(16), "refusing", workers=2)
    with pytest.raises(AdvpipeError, match="already exists; pass overwrite=True to replace"):
        run_jobs(refusal, range(16), "refusing", workers=2)


def test_both_users_read_their_own(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "advpipe", "attack", "nowhere", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, without_progress(done.stderr)) == (
        2,
        f"advpipe: {tmp_path} already exists; pass --overwrite to replace it\n",
    )
    with pytest.raises(advpipe.UsageError, match="already exists; pass overwrite=True to replace it"):
        advpipe.attack("nowhere", out=tmp_path)
