"""The names that shells complete, through the completion of the real command line."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("advpipe attack --type cam-delay", ["cam-delay"]),
        ("advpipe attack --type gnss-drift", ["gnss-drift", "gnss-drift-aware"]),
        ("advpipe attacks det", ["detach"]),
        ("advpipe simulate dis", ["district"]),
        ("advpipe run cooper", ["cooperative"]),
        ("advpipe attack --detector sm", ["small"]),
        ("advpipe evaluate --detector s", ["small"]),
        ("advpipe evaluate --defence j", ["jitter"]),
        ("advpipe evaluate --detect-attacks vo", ["voxel-face"]),
        ("advpipe attack --recipe random-", ["random-near", "random-best"]),
        ("advpipe attack --type cam-delay --recipe r", []),
        ("advpipe attack --ra", ["--ratio"]),
        ("advpipe attack --goal h", ["hide"]),
        ("advpipe attack --type=gnss-jump --mode s", ["step"]),
        ("advpipe attack --device cu", ["cuda"]),
        ("advpipe evaluate --device c", ["cpu", "cuda"]),
        ("advpipe sweep --table p", ["paper"]),
        ("advpipe sweep --recipes best,random-n", ["best,random-near"]),
        ("advpipe train --preset k", ["kitti"]),
        ("advpipe train --family p", ["pointpillars"]),
        ("advpipe import open", ["openpcdet"]),
        ("advpipe export --format nu", ["nuscenes"]),
        ("advpipe plot --format s", ["svg"]),
        ("advpipe figures --format p", ["pdf", "png"]),
        ("advpipe schema --of r", ["report", "relay"]),
    ],
)
def test_values_are_completed(typed: str, expected: list[str]) -> None:
    environment = {
        **os.environ,
        "_ADVPIPE_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(typed.split()) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-m", "advpipe"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == expected, done.stderr
