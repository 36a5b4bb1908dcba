"""Whether log times and header stamps of every topic never go backwards."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.messages import build
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result
from advpipe.stages.verify.subject import BagUnderTest


class Time(MessageCheck):
    """Checks messages in the order of the file."""

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._log_ns: dict[str, int] = {}
        self._stamp_ns: dict[str, int] = {}

    def see(self, view: MessageView) -> Iterator[Result]:
        name, log_ns = view.raw.topic.name, view.raw.log_time_ns
        if log_ns < self._log_ns.get(name, 0):
            yield Fault(view.where, f"log times go backwards to {log_ns} ns")
        self._log_ns[name] = log_ns
        if view.header is None:
            return
        stamp_ns = build.stamp_ns(view.message)
        if stamp_ns < self._stamp_ns.get(name, stamp_ns):
            yield Fault(view.where, f"header stamps go backwards to {stamp_ns} ns")
        self._stamp_ns[name] = stamp_ns

    def check(self) -> Iterator[Result]:
        return iter(())
