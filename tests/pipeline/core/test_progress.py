"""Progress: one bar a command on a terminal, a line every ten seconds elsewhere, nothing with --quiet."""

from __future__ import annotations

import os
import pty
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from advpipe.pipeline.core import phases, progress, status_line
from advpipe.pipeline.core.progress import open_progress, plan_progress, track, with_progress, working_on
from advpipe.pipeline.core.streams import safe_streams
from advpipe.pipeline.core.verbosity import Verbosity, notice, print_result, use_verbosity

Shown = Callable[[], str]


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines come every twentieth of a second, so that tests take less than one."""
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.05)
    monkeypatch.setattr(progress, "FIRST_WORD_S", 0.02)


@contextmanager
def on_terminal() -> Iterator[Shown]:
    """Standard error is a terminal; gives what it has shown."""
    ours, theirs = pty.openpty()
    with pytest.MonkeyPatch.context() as patch, open(theirs, "w", encoding="utf-8") as terminal:
        patch.setattr(progress, "DRAW_EVERY_S", 0.01)
        patch.setenv("TERM", "xterm")
        patch.setattr(sys, "stderr", terminal)

        collected = bytearray()

        def collect() -> None:  # a terminal that nobody reads from stops whoever writes
            with suppress(OSError):
                while block := os.read(ours, 1 << 16):
                    collected.extend(block)

        threading.Thread(target=collect, daemon=True).start()

        def read() -> str:
            time.sleep(0.2)
            return collected.decode(errors="replace")

        yield read
    os.close(ours)


def test_the_first_word_comes_at_once_and_then_a_line_now_and_then(
    soon: None, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_progress("evaluating d\x1b"):
        plan_progress({"loading": 1, "detecting": 1})
        with working_on("loading"):
            time.sleep(0.3)
        for _ in track(range(2), "detecting", status=lambda: "loss 1"):
            time.sleep(0.3)
    first, *lines = capsys.readouterr().err.splitlines()
    assert first == "evaluating d\\x1b ..."
    assert "evaluating d\\x1b: loading" in lines
    counted = r"evaluating d\\x1b: detecting: 1 of 2, about \d+ s left; loss 1"
    assert any(re.fullmatch(counted, line) for line in lines), lines
    time.sleep(0.2)
    assert capsys.readouterr() == ("", "")  # nothing after its end


def test_an_estimate_falls_until_the_next_item_and_needs_one(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimpleNamespace(now_s=100.0)
    clock.monotonic = lambda: clock.now_s
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(phases, "time", clock)

    def left_after(duration_s: float) -> str:
        clock.now_s += duration_s
        return progress._display._left()  # type: ignore[union-attr]

    with use_verbosity(Verbosity()), open_progress("attacking", at_once=False):
        plan_progress({"loading": 1, "clouds": 9})
        with working_on("loading"):
            clock.now_s += 10
        items = track(range(3), "clouds")
        next(items)
        assert left_after(10) == ""  # no cloud is done
        next(items)
        assert left_after(0) == "30 s"  # 20 s for 40 %
        assert [left_after(10), left_after(10)] == ["20 s", "10 s"]
        assert left_after(15) == ""  # later than it was expected
        with working_on("writing"):
            assert left_after(5) == ""
        next(items)
        assert left_after(5) == "21 s"  # 60 s for 70 % when the second was done, 5 s ago


def test_quick_work_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(track(range(100), "read", 100)) == list(range(100))
    with open_progress("reading", at_once=False), working_on("hashing"):
        pass
    assert capsys.readouterr() == ("", "")


def test_work_without_a_command_says_what_it_is_when_it_takes_long(
    soon: None, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in track(iter(range(3)), "read"):
        time.sleep(0.1)
    assert "read: 2" in capsys.readouterr().err.splitlines()


def test_quiet_prints_nothing(soon: None, capsys: pytest.CaptureFixture[str]) -> None:
    with use_verbosity(Verbosity(quiet=True)), open_progress("reading"):
        for _ in track(range(2), "read", 2):
            time.sleep(0.1)
    assert capsys.readouterr() == ("", "")


def test_a_command_within_a_command_is_a_part_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    with open_progress("running"):
        plan_progress({"attacking": 1, "evaluating": 1})
        with working_on("attacking"), open_progress("another"):
            plan_progress({"clouds": 1})
            for _ in track(range(2), "clouds"):
                place = progress._display.phases[-1].done  # type: ignore[union-attr]
        assert place == pytest.approx(0.25)
        with working_on("evaluating"):
            assert progress._display.phases[-1].begin == 0.5  # type: ignore[union-attr]
    assert capsys.readouterr().err == "running ...\n"


def test_after_an_error_the_outer_phase_goes_on() -> None:
    with open_progress("running"):
        with pytest.raises(ValueError, match="no"), working_on("attacking"):
            raise ValueError("no")
        assert [phase.name for phase in progress._display.phases] == ["running"]  # type: ignore[union-attr]
        broken = track(range(3), "left in the middle")
        next(broken)
        del broken
        assert len(progress._display.phases) == 1  # type: ignore[union-attr]
    assert progress._display is None


def test_another_thread_is_no_part_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    with open_progress("viewing"):
        other = threading.Thread(target=lambda: list(track(range(3), "serving")))
        other.start()
        other.join()
        assert [phase.name for phase in progress._display.phases] == ["viewing"]  # type: ignore[union-attr]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks at a thread in /proc")
def test_signals_go_to_the_main_thread_alone() -> None:
    """One that the main thread blocks, while it starts a worker, must not come through another."""
    with open_progress("simulating", at_once=False):
        thread = progress._display._thread.native_id  # type: ignore[union-attr]
        status = Path(f"/proc/self/task/{thread}/status").read_text()
    blocked = int(next(line for line in status.splitlines() if line.startswith("SigBlk")).split()[1], 16)
    assert all(blocked >> (number - 1) & 1 for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))


def test_words_name_the_arguments(capsys: pytest.CaptureFixture[str]) -> None:
    @with_progress("attacking {bag} with {type} into {out}")
    def attack(bag: object = None, *more: str, type: str, out: Path | None = Path("o")) -> str:
        return type

    assert attack(type="detach") == attack("a", type="x" * 200)[:0] + "detach"
    assert attack([Path("a"), Path("b"), Path("c")], type="detach") == "detach"
    first, long, several = capsys.readouterr().err.splitlines()
    assert first == "attacking the newest data set with detach into o ..."
    assert len(long) < 150
    assert several == "attacking a and 2 more with detach into o ..."


def test_a_terminal_shows_one_bar_that_goes() -> None:
    """Though the streams are safe; what is printed meanwhile stands above it, and nothing is left of it."""
    with on_terminal() as shown, safe_streams():
        with open_progress("read \x1b]0;x\x07[red]"):
            plan_progress({"one": 1, "two": 1})
            for number in track(range(4), "one"):
                time.sleep(0.05)
                if number == 2:
                    notice("a note")
            with working_on("two"):
                time.sleep(0.05)
        text = shown()
    assert "read \\x1b]0;x\\x07[red]: one: 2 of 4" in text
    assert "50 %" in text
    assert "\r\x1b[Ka note\r\n" in text
    assert "\x1b]0;" not in text
    percents = [int(found) for found in re.findall(r"(\d+) %", text)]
    assert percents == sorted(percents)
    assert max(percents) < 100
    assert text.endswith("\r\x1b[K")


def test_the_bar_fits_the_terminal() -> None:
    with on_terminal() as shown:
        with open_progress("x" * 300), working_on("界" * 100):
            time.sleep(0.05)
        text = shown()
    drawn = text.split("\r\x1b[K")
    assert "界" in drawn[-2]
    assert max(len(line) + line.count("界") for line in drawn) < 80


def test_what_is_printed_goes_above_the_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with on_terminal() as shown:
        with open_progress("sweeping"):
            print_result("cell")
            with status_line.above_status():
                time.sleep(0.05)
                before = status_line.erasing_bytes()
        text = shown()
    assert before == b""
    assert text.count("\r\x1b[K") > 2
    assert capsys.readouterr().out == "cell\n"
