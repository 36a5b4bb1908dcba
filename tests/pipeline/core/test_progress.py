"""Progress: a bar on a terminal, a line every ten seconds elsewhere, nothing with --quiet."""

from __future__ import annotations

import os
import pty
import select
import sys

import pytest

from advpipe.pipeline.core import progress
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.streams import safe_streams
from advpipe.pipeline.core.verbosity import Verbosity, use_verbosity


@pytest.fixture
def four_seconds_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every look at the clock is four seconds after the one before."""
    clock = iter(range(0, 10_000, 4))
    monkeypatch.setattr(progress.time, "monotonic", lambda: float(next(clock)))


@pytest.mark.usefixtures("four_seconds_each")
def test_a_line_is_printed_every_ten_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(track(range(8), "read\x1b", status=lambda: "loss 1")) == list(range(8))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "read\\x1b: 3 of 8, about 20 s left; loss 1",
        "read\\x1b: 6 of 8, about 8 s left; loss 1",
    ]


@pytest.mark.usefixtures("four_seconds_each")
def test_without_a_total_only_the_count_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert sum(track(iter(range(4)), "read")) == 6
    assert capsys.readouterr().err == "read: 3\n"


def test_quick_work_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(track(range(100), "read", 100)) == list(range(100))
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("four_seconds_each")
def test_quiet_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with use_verbosity(Verbosity(quiet=True)):
        assert len(list(track(range(100), "read", 100))) == 100
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the streams are safe; the description is spelt out, and is no markup."""
    ours, theirs = pty.openpty()
    with open(theirs, "w", encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with safe_streams():
            assert list(track(range(3), "read \x1b]0;x\x07[red]", 3)) == [0, 1, 2]
        terminal.flush()
        shown = ""
        while "3/3" not in shown and select.select([ours], [], [], 10)[0]:
            shown += os.read(ours, 1 << 16).decode()
    os.close(ours)
    assert "read \\x1b]0;x\\x07[red]" in shown
    assert "3/3" in shown
    assert "\x1b]0;" not in shown
