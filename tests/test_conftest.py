"""A missing oracle on the integration server."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

@pytest.mark.oracle
def test_inside():
    pytest.importorskip("no_such_oracle")

@pytest.mark.oracle
@pytest.mark.skipif(True, reason="no such program")
def test_before():
    raise AssertionError

def test_no_oracle():
    pytest.skip("somewhere else")
"""


@pytest.mark.parametrize(
    ("server", "counts"),
    [("", "3 skipped"), ("true", "1 failed, 1 skipped, 1 error")],
    ids=["user", "server"],
)
def test_a_missing_oracle_fails_on_the_server_alone(tmp_path: Path, server: str, counts: str) -> None:
    shutil.copy(Path(__file__).with_name("conftest.py"), tmp_path)
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = oracle\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:dash", "-p", "no:cacheprovider"],
        cwd=tmp_path,
        env={**os.environ, "CI": server},
        capture_output=True,
        text=True,
    )
    assert counts in done.stdout
    assert ("oracle missing" in done.stdout) == bool(server)
