"""Carries out a page from top to bottom in the working folder, in this process, which has the libraries."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import blocks

from advpipe.pipeline.cli import app

COARSE = "--set sensors.lidars.lidar.points_per_second=7200 --set sensors.lidars.lidar.rotation_frequency=2"
"""Added to every `advpipe simulate smoke`: few clouds of few points, for a small part of the time."""
LONG = "runs/eye"
"""Trained for half an hour; commands that name it are not carried out."""
ALONE = ("sonar.py",)
"""Files that register a sensor, which they have to do before a scenario is read: each in its own process."""


def carry_out(page: str) -> None:
    """Raises what a block of Python raises, and SystemExit where a command fails."""
    for block in blocks.blocks(blocks.ROOT / page):
        if block.file_name:
            Path(block.file_name).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            exec(compile(block.text, blocks.where(block), "exec"), {"__name__": "__main__"})
        elif block.language == "bash" and page in blocks.RUN:
            for arguments in block.commands:
                if not any(LONG in argument for argument in arguments):
                    command(arguments)


def command(arguments: list[str]) -> None:
    """A command of advpipe or a Python file, or any other program as a process."""
    print("$", *arguments, flush=True)
    program, *rest = arguments
    if program == "advpipe":
        try:
            app(rest + COARSE.split() * (rest[:2] == ["simulate", "smoke"]))
        except SystemExit as ended:
            if ended.code:
                raise
    elif program == "python" and rest[0] not in ALONE:
        runpy.run_path(rest[0], run_name="__main__")
    else:
        subprocess.run([sys.executable if program == "python" else program, *rest], check=True)
