"""A target with planted faults: every type of fault that the fuzzer must find, and two correct outcomes."""

from __future__ import annotations

import os
import time
from pathlib import Path

from hypothesis import strategies as st

from advpipe.pipeline.core import plain_yaml
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target

FILE = "text.yaml"
FAULTS = {
    "raises": "exception",
    "aborts": "crash",
    "sleeps": "hang",
    "grows": "memory",
    "shouts": "terminal",
    "rambles": "line",
    "leaves": "leftover",
}
"""The kind of fault of each call."""


class _Mute:
    def __str__(self) -> str:
        raise KeyError("planted")


def _grow() -> None:
    held = []
    while True:
        held.append(b"x" * (16 << 20))


def _leave(out: Path) -> None:
    (out / "half.txt").write_text("half", encoding="utf-8")
    raise AdvpipeError("refused, too late")


def _refuse(text: str) -> None:
    raise AdvpipeError(text)


def _load(tree: Path, out: Path) -> None:
    """Not planted: the bounded reader of untrusted YAML."""
    try:
        plain_yaml.load_yaml((tree / FILE).read_text(encoding="utf-8", errors="replace"))
    except Exception as error:
        raise AdvpipeError(f"{FILE}: {error}") from None


CALLS: dict[str, Call] = {
    "loads": _load,
    "refuses": lambda tree, out: _refuse("one line"),
    "raises": lambda tree, out: one_line(_Mute()),
    "aborts": lambda tree, out: os.abort(),
    "sleeps": lambda tree, out: time.sleep(1000),
    "grows": lambda tree, out: _grow(),
    "shouts": lambda tree, out: "a \x1b[31mred\x1b[0m word",
    "rambles": lambda tree, out: _refuse("word " * 10_000),
    "leaves": lambda tree, out: _leave(out),
}


def cases(folder: Path) -> st.SearchStrategy[Case]:
    calls = st.sampled_from([*CALLS, *["loads"] * 20])
    return st.builds(lambda call, data: Case(call, FILE, data), calls, st.binary(max_size=40))


TARGET = Target("planted", base.TABLES, cases, CALLS)
