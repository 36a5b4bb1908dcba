"""The words of the attacks, and where users read of them."""

from __future__ import annotations

import re
from pathlib import Path

from advpipe.pipeline.scenario.attacks import PAPER_NAMES
from advpipe.stages.attack.registry import ATTACKS, find_attack

README = Path(__file__).parents[3] / "README.md"


def test_the_readme_tells_of_each():
    """Those of the paper have rows that say so, beside the names that the paper gives them."""
    text = README.read_text(encoding="utf-8")
    told = set(re.findall(r"`((?:cam|gnss)-[a-z-]+)`", text))
    assert told == {word for word in ATTACKS if word.startswith(("cam-", "gnss-"))}
    for short, word in PAPER_NAMES.items():
        (row,) = [line for line in text.splitlines() if line.startswith("|") and f"`{word}`" in line]
        assert f"({short.upper()})" in row.split("|")[1]
        assert f"`{short}`" in row.split("|")[2]


def test_each_word_has_a_class():
    for word in ATTACKS:
        assert isinstance(find_attack(word), type)
