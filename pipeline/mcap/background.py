"""Calls that run one after the other in a thread of their own, while the caller goes on."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Background:
    """Runs calls in their order; what one of them raises is raised by the caller's next `call` or `finish`.

    waiting: calls that may lie in wait; one more, and the caller waits itself, which bounds the memory.
    """

    def __init__(self, waiting: int) -> None:
        self._waiting = waiting
        self._pool = ThreadPoolExecutor(1)
        self._calls: deque[Future[None]] = deque()

    def call(self, work: Callable[..., None], *arguments: object) -> None:
        while self._calls and (len(self._calls) > self._waiting or self._calls[0].done()):
            self._calls.popleft().result()
        self._calls.append(self._pool.submit(work, *arguments))

    def finish(self) -> None:
        """Waits until all is done."""
        while self._calls:
            self._calls.popleft().result()
        self._pool.shutdown()

    def abort(self) -> None:
        """Drops the waiting calls, and waits for the running one."""
        self._pool.shutdown(cancel_futures=True)
