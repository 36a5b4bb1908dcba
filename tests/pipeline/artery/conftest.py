"""The stand-in for Artery, as the program of this machine."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

STANDIN = Path(__file__).parent / "standin.py"


@pytest.fixture
def artery(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Makes the stand-in with these arguments the program that `ADVPIPE_ARTERY_BIN` names.

    Returns where its process id is; a copy of its configuration, `omnetpp.ini`, is beside it.
    """

    def write(*arguments: str) -> Path:
        program = tmp_path / "advpipe-artery"
        pid = tmp_path / "pid"
        command = shlex.join([sys.executable, str(STANDIN), *arguments])
        program.write_text(
            f'#!/bin/sh\necho $$ >{pid}\ncp omnetpp.ini {tmp_path}\nexec {command} "$@"\n', encoding="utf-8"
        )
        program.chmod(0o755)
        monkeypatch.setenv("ADVPIPE_ARTERY_BIN", str(program))
        return pid

    return write
