"""Whether time goes forward on every topic: that of the log, and that in the messages' headers."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.messages import build
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result
from advpipe.stages.verify.subject import Bag


class Time(MessageCheck):
    """In the order in which messages lie in the file."""

    def __init__(self, bag: Bag) -> None:
        super().__init__(bag)
        self._log_ns: dict[str, int] = {}
        self._stamp_ns: dict[str, int] = {}

    def see(self, seen: MessageView) -> Iterator[Result]:
        name, log_ns = seen.raw.topic.name, seen.raw.log_time_ns
        if log_ns < self._log_ns.get(name, 0):
            yield Fault(seen.where, f"log times go backwards to {log_ns} ns")
        self._log_ns[name] = log_ns
        if seen.header is None:
            return
        stamp_ns = build.stamp_ns(seen.message)
        if stamp_ns < self._stamp_ns.get(name, stamp_ns):
            yield Fault(seen.where, f"header stamps go backwards to {stamp_ns} ns")
        self._stamp_ns[name] = stamp_ns

    def check(self) -> Iterator[Result]:
        return iter(())
