import threading
import time

import pytest

from advpipe.pipeline.mcap.background import Background


def test_calls_run_in_order_in_another_thread() -> None:
    background, done = Background(3), list[tuple[int, int]]()
    for number in range(50):
        background.call(lambda number=number: done.append((number, threading.get_ident())))
    background.finish()
    assert [number for number, _ in done] == list(range(50))
    assert threading.get_ident() not in {thread for _, thread in done}


def test_the_caller_waits_if_the_queue_is_full() -> None:
    background, gate, most, waiting = Background(2), threading.Event(), 0, [0]

    def work() -> None:
        gate.wait(10)
        waiting[0] -= 1

    threading.Timer(0.2, gate.set).start()
    for _ in range(10):
        waiting[0] += 1
        background.call(work)
        most = max(most, waiting[0])
    background.finish()
    assert gate.is_set()
    assert most <= 4  # two in wait, one that runs, one just handed over


def fail() -> None:
    raise OSError(28, "No space left on device")


def test_the_next_call_raises_an_earlier_error() -> None:
    background = Background(2)
    background.call(fail)
    time.sleep(0.05)
    with pytest.raises(OSError, match="No space"):
        background.call(print)
    background.abort()


def test_an_abort_drops_queued_calls() -> None:
    background, started, done = Background(8), threading.Event(), list[int]()
    background.call(lambda: (started.set(), time.sleep(0.1), done.append(0)))
    for number in range(1, 8):
        background.call(done.append, number)
    started.wait(10)
    background.abort()
    assert done == [0]
    background.abort()  # twice does no harm
