"""The stand-in for Artery, as a program."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

STANDIN = Path(__file__).parent / "standin.py"


@pytest.fixture(scope="session")
def standin(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Writes a program that runs the stand-in with these arguments; returns its path."""

    def write(*arguments: str) -> Path:
        program = tmp_path_factory.mktemp("standin") / "advpipe-artery"
        command = shlex.join([sys.executable, str(STANDIN), *arguments])
        program.write_text(f'#!/bin/sh\nexec {command} "$@"\n', encoding="utf-8")
        program.chmod(0o755)
        return program

    return write
