"""Records what was sent, with labels, in a thread of its own, so that nothing waits for the disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from threading import Lock, Thread
from types import TracebackType

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.labels.clouds import PointTables
from advpipe.pipeline.mcap.channel import Topic

MOST_BYTES = 256_000_000
"""Of messages in wait: 14 s of clouds of 80,000 points at 10 Hz."""

TASK_BYTES = 1_000
"""What a task counts beside its message."""


class Recorder:
    """Does tasks in their order while the caller goes on.

    bag: open for writing; nobody else may use it meanwhile. debug: whether it is to have debug topics.
    lost: how many messages and labels were not recorded since the disk was too slow.
    """

    def __init__(self, bag: BagWriter, *, debug: bool, has_clouds: bool) -> None:
        self.debug, self.lost, self.recorded = debug, 0, 0
        self._bag = bag
        self._tables = PointTables(bag.folder) if has_clouds else None
        self._tasks: SimpleQueue[tuple[Callable[[], None], int] | None] = SimpleQueue()
        self._waiting_bytes, self._lock = 0, Lock()
        self._error: BaseException | None = None
        self._thread = Thread(target=self._work, name="recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._tasks.put(None)
        self._thread.join()
        if self._tables is not None:
            self._tables.__exit__(None, None, None)
        if kind is None:
            self._raise()

    @property
    def folder(self) -> Path:
        """Where tables of labels are made."""
        return self._bag.folder

    @property
    def point_tables(self) -> PointTables:
        """The labels of clouds, for tasks alone."""
        assert self._tables is not None
        return self._tables

    def call(self, task: Callable[[], None], size_bytes: int = 0) -> None:
        """Do this later, with a message of this size. Raises what an earlier task raised, as AdvpipeError
        for a full disk."""
        self._raise()
        cost_bytes = size_bytes + TASK_BYTES
        with self._lock:
            if self._waiting_bytes + cost_bytes > MOST_BYTES:
                self.lost += 1
                return
            self._waiting_bytes += cost_bytes
        self._tasks.put((task, cost_bytes))

    def record(self, topic: Topic, cdr: bytes, time_ns: int) -> None:
        """Write a message later."""
        self.call(lambda: self.write(topic, cdr, time_ns), len(cdr))

    def write(self, topic: Topic, cdr: bytes, time_ns: int) -> None:
        """Write a message; for tasks alone."""
        self._bag.write_cdr(topic, cdr, time_ns)
        self.recorded += 1

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        while (waiting := self._tasks.get()) is not None:
            task, cost_bytes = waiting
            if self._error is None:
                try:
                    task()
                except BaseException as error:  # raised where the recorder is used
                    self._error = error
            with self._lock:
                self._waiting_bytes -= cost_bytes
