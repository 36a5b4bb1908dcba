"""Carries out one page from top to bottom in the working folder: python carry_out.py docs/tutorial.md.

Python and `advpipe` commands run in this process, so that the libraries are loaded once; with one processor,
no workers load them again.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import blocks

from advpipe.pipeline.cli import app


def carry_out(page: str, is_run: bool) -> None:
    """Raises what a block of Python raises, and SystemExit where a command fails."""
    for block in blocks.blocks(blocks.ROOT / page):
        if block.file_name:
            Path(block.file_name).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            exec(compile(block.text, blocks.where(block), "exec"), {"__name__": "__main__"})
        elif block.language == "bash" and is_run:
            for words in block.commands:
                command(words)


def command(words: list[str]) -> None:
    """A command of advpipe here, any other as a process."""
    print(f"{time.process_time():.1f} s: $", *words, flush=True)
    if words[0] != "advpipe":
        subprocess.run([sys.executable if words[0] == "python" else words[0], *words[1:]], check=True)
        return
    try:
        app(words[1:])
    except SystemExit as ended:
        if ended.code:
            raise


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    carry_out(sys.argv[1], sys.argv[2] == "run")
