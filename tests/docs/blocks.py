"""Every fenced block of the READMEs, CONTRIBUTING.md and the pages of docs/."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
RUN = ("docs/tutorial.md", "docs/extending.md", "docs/camera.md", "docs/radar.md")
"""Pages whose commands are carried out; those of the others are parsed."""
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted(
        path for part in ("benchmarks", "datasets", "pipeline") for path in (ROOT / part).rglob("README.md")
    ),
]
_FENCE = re.compile(r"^( *)(`{3,})([^\n`]*)\n(.*?)^\1\2 *$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """One fenced block. language: the first word after the fence, "" where none stands there."""

    page: str
    line: int
    language: str
    text: str

    @property
    def file_name(self) -> str:
        """The file that the block is, where its first line is a comment that names one, as in `# mine.py`."""
        found = re.match(r"# ([\w.-]+\.(?:py|yaml))$", self.text.partition("\n")[0])
        return found[1] if found else ""

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a block of bash, comments left out, continued lines joined."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [arguments for line in lines if (arguments := shlex.split(line, comments=True))]


def blocks(path: Path) -> list[Block]:
    """Those of one page, in order."""
    text = path.read_text(encoding="utf-8")
    page = path.relative_to(ROOT).as_posix()
    return [
        Block(page, text.count("\n", 0, it.start()) + 1, (it[3].split() or [""])[0], it[4])
        for it in _FENCE.finditer(text)
    ]


ALL = [block for page in PAGES for block in blocks(page)]


def of(*languages: str) -> list[Block]:
    """All blocks in one of these languages."""
    return [block for block in ALL if block.language in languages]


def where(block: Block) -> str:
    """For the names of tests."""
    return f"{block.page}:{block.line}"
