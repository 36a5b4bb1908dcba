"""Networks made for a test by SUMO's own generator."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.stages.simulate.network_file import sumo_program


@pytest.fixture
def grid(tmp_path: Path) -> Callable[..., Path]:
    """Makes a grid network with the given options of netgenerate."""

    def generate(*options: str) -> Path:
        out = tmp_path / "grid.net.xml"
        command = [sumo_program("netgenerate"), "--grid", *options, "--output-file", str(out)]
        subprocess.run(command, check=True, capture_output=True)
        return out

    return generate
