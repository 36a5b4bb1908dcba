"""What subscribers that do not acknowledge miss, with a writer that tells what the test wants."""

import time
from threading import Event

import pytest

from advpipe.pipeline.live import acknowledgements
from advpipe.pipeline.live.acknowledgements import ASKING_BYTES, AcknowledgementWatch


class Subscriber:
    """Acknowledges nothing for the whole time, or everything at once."""

    def __init__(self) -> None:
        self.is_quick, self.asked = True, Event()

    def __call__(self, timeout_s: float) -> bool:
        self.asked.set()
        if not self.is_quick:
            time.sleep(timeout_s)
        return self.is_quick


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acknowledgements, "PATIENCE_S", 0.3)


def ended(watch: AcknowledgementWatch) -> AcknowledgementWatch:
    watch.end()
    watch.join()
    return watch


def write(watch: AcknowledgementWatch, count: int, size_bytes: int = ASKING_BYTES + 1) -> None:
    for _ in range(count):
        watch.count(size_bytes)


def test_a_quick_subscriber_misses_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    watch = AcknowledgementWatch("/words", 2, Subscriber())
    write(watch, 100)
    assert ended(watch).missed == 0
    assert capsys.readouterr().err == ""


def test_what_left_the_history_is_missed_and_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Of 15 messages beyond the first, the last five may still be taken; at the end nothing is kept."""
    subscriber = Subscriber()
    watch = AcknowledgementWatch("/words", 5, subscriber)
    subscriber.is_quick = False
    write(watch, 1)
    assert subscriber.asked.wait(10)
    write(watch, 15)
    time.sleep(0.45)
    assert watch.missed == 11
    assert ended(watch).missed == 12
    assert capsys.readouterr().err == (
        "/words: a reliable subscriber is too slow, or gone: it has acknowledged nothing for 0.3 s and "
        "misses what is older than the last 5\n"
    )


def test_who_is_asked_for_nothing_may_be_silent() -> None:
    """Between small messages in quick succession; when they end, everybody is asked."""
    subscriber = Subscriber()
    watch = AcknowledgementWatch("/words", 5, subscriber)
    subscriber.is_quick = False
    for _ in range(60):
        write(watch, 1, size_bytes=10)
        time.sleep(0.02)
    assert subscriber.asked.is_set()
    assert watch.missed == 0
    subscriber.is_quick = True
    assert ended(watch).missed == 0


def test_one_that_comes_again_is_quick() -> None:
    subscriber = Subscriber()
    watch = AcknowledgementWatch("/words", 1, subscriber)
    subscriber.is_quick = False
    write(watch, 1)
    assert subscriber.asked.wait(10)
    write(watch, 3)
    time.sleep(0.45)
    subscriber.is_quick = True
    write(watch, 50)
    assert ended(watch).missed == 3
