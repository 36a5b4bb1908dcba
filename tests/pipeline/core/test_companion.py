"""A companion process: answers in order, its errors, its death and its end."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from advpipe.pipeline.core.companion import Companion
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.job_errors import UnexpectedInWorkerError

CODE = """
import os
from advpipe.pipeline.core.errors import UsageError

asked = 0

def prepare():
    return answer

def answer(question):
    global asked
    asked += 1
    if question == "die":
        os._exit(3)
    if question == "refuse":
        raise UsageError("such questions are not answered; ask another")
    if question == "fail":
        raise ZeroDivisionError
    return asked, question * 2
"""

Doubling = Companion[str, tuple[int, str]]


@pytest.fixture
def companion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Doubling]:
    """Its work is in a module of its own, which another process can import."""
    (tmp_path / "doubling.py").write_text(CODE)
    monkeypatch.syspath_prepend(tmp_path)
    import doubling  # type: ignore[import-not-found]

    prepare: Callable[[], Callable[[str], tuple[int, str]]] = doubling.prepare
    with closing(Companion(prepare)) as one:
        yield one
    del sys.modules["doubling"]


def test_answers_come_in_order_however_large_both_sides_messages_are(companion: Doubling) -> None:
    large = "x" * 3_000_000
    answers = [companion.ask(large) for _ in range(3)]
    answers.append(companion.ask("y"))
    expected = [*((number, large * 2) for number in (1, 2, 3)), (4, "yy")]
    assert [answer.result(60) for answer in answers] == expected


@pytest.mark.parametrize(
    ("question", "error", "line"),
    [
        ("refuse", UsageError, "such questions"),
        ("fail", UnexpectedInWorkerError, "ZeroDivisionError"),
        ("die", AdvpipeError, "a worker process died"),
    ],
)
def test_an_error_is_raised_by_its_answer_and_by_all_later_ones(
    companion: Doubling, question: str, error: type[Exception], line: str
) -> None:
    first, second, third = (companion.ask(each) for each in ("a", question, "b"))
    assert first.result(60) == (1, "aa")
    for answer in (second, third, companion.ask("c")):
        with pytest.raises(error, match=line):
            answer.result(60)


def test_closing_ends_the_process_while_it_works(companion: Doubling) -> None:
    companion.ask("x" * 3_000_000)
    companion.close()
    assert not companion._process.is_alive()
