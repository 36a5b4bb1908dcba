"""Runs calls one after another in a background thread while the caller continues."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Background:
    """A thread that runs calls in order. An exception in one is raised by the next `call` or `finish`.

    waiting: the number of calls that may be queued. With more, `call` blocks, which bounds the memory.
    """

    def __init__(self, waiting: int) -> None:
        self._waiting = waiting
        self._pool = ThreadPoolExecutor(1)
        self._calls: deque[Future[None]] = deque()

    def call(self, work: Callable[..., None], *arguments: object) -> None:
        """Queue a call; wait first if the queue is full. Raises the exception of an earlier call."""
        while self._calls and (len(self._calls) > self._waiting or self._calls[0].done()):
            self._calls.popleft().result()
        self._calls.append(self._pool.submit(work, *arguments))

    def finish(self) -> None:
        """Wait until all calls are done. Raises the exception of the first call that failed."""
        while self._calls:
            self._calls.popleft().result()
        self._pool.shutdown()

    def abort(self) -> None:
        """Drop the queued calls and wait for the running one."""
        self._pool.shutdown(cancel_futures=True)
