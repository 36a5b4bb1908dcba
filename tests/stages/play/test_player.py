"""Messages in time, with pauses and stops; the publisher is one that remembers, and keys come from a list."""

import time
from collections.abc import Sequence

import pytest

from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.stages.play.keyboard import PAUSE, QUIT, Keyboard
from advpipe.stages.play.player import Player

TOPIC = Topic("/words", "std_msgs/msg/String")
BEGIN_NS = 10**18


class Remembering:
    """Notes when it got which message; takes no messages of odd times."""

    def __init__(self) -> None:
        self.got: list[tuple[float, int]] = []

    def advertise(self, published: PublishedTopic) -> None: ...

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        self.got.append((time.monotonic(), time_ns))
        return time_ns % 2 == 0

    def close(self) -> None: ...


class Keys(Keyboard):
    """Presses keys at given seconds."""

    is_there = True

    def __init__(self, *presses: tuple[float, str]) -> None:
        super().__init__()
        self._begin_s = time.monotonic()
        self._presses = list(presses)

    def wait(self, timeout_s: float) -> str:
        end_s = time.monotonic() + timeout_s
        while True:
            if self._presses and time.monotonic() - self._begin_s >= self._presses[0][0]:
                return self._presses.pop(0)[1]
            if time.monotonic() >= end_s:
                return ""
            time.sleep(0.001)


def messages(times_s: Sequence[float]) -> list[RawMessage]:
    return [RawMessage(TOPIC, "", b"", BEGIN_NS + round(t * 1e9), 0, 0) for t in times_s]


@pytest.mark.parametrize("rate", [1.0, 4.0])
def test_messages_come_at_their_times(rate: float) -> None:
    """Never early; how late is what the player says."""
    times_s = [0.0, 0.0, 0.1, 0.25, 0.4]
    remembering = Remembering()
    player = Player([remembering], Keyboard(), lambda: False)
    begin_s = time.monotonic()
    player.play(messages(times_s), BEGIN_NS, rate)
    late_s = [at - begin_s - t / rate for (at, _), t in zip(remembering.got, times_s, strict=True)]
    assert min(late_s) > -1e-4
    assert max(late_s) < player.lateness.max_s + 0.05
    assert player.sent == {"/words": 5}
    assert player.recorded_ns == 400_000_000


def test_a_pause_and_an_end_by_key() -> None:
    remembering = Remembering()
    player = Player([remembering], Keys((0.15, PAUSE), (0.55, PAUSE), (0.8, QUIT)), lambda: False)
    begin_s = time.monotonic()
    player.play(messages([0.0, 0.1, 0.2, 0.3, 5.0]), BEGIN_NS, 1.0)
    at_s = [at - begin_s for at, _ in remembering.got]
    assert len(at_s) == 4
    assert at_s[1] < 0.3
    assert at_s[2] > 0.55
    assert player.has_ended
    assert time.monotonic() - begin_s < 3


def test_keys_are_heard_where_it_never_waits() -> None:
    """All messages are due at once."""
    player = Player([Remembering()], Keys((0.0, QUIT)), lambda: False)
    player.play(messages([0.0] * 1000), BEGIN_NS, 1.0)
    assert player.sent["/words"] < 1000


def test_a_stop_by_signal_and_messages_that_are_not_taken() -> None:
    begin_s = time.monotonic()
    player = Player([Remembering()], Keyboard(), lambda: time.monotonic() - begin_s > 0.3)
    odd = RawMessage(TOPIC, "", b"", BEGIN_NS + 1, 0, 0)
    player.play([*messages([0.0]), odd, *messages([60.0])], BEGIN_NS, 1.0)
    assert player.sent == player.dropped == {"/words": 1}
    assert time.monotonic() - begin_s < 5


def test_a_rate_that_no_machine_keeps_is_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    class Slow(Remembering):
        def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
            time.sleep(0.4)
            return True

    player = Player([Slow()], Keyboard(), lambda: False)
    player.play(messages([0.0] * 6), BEGIN_NS, 1.0)
    assert capsys.readouterr().err.count("does not keep up with rate 1") == 1
    assert player.lateness.max_s > 1.5
