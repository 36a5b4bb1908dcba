"""Whether an adversarial bag contains everything that its attack did not touch, byte for byte."""

from __future__ import annotations

import hashlib
from collections import Counter, deque
from collections.abc import Iterator
from typing import NamedTuple

from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.stages.verify.checks.attacked import AttackedBag, latched_topics
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result


class _Copy(NamedTuple):
    """The fields that a message and its copy share; log_time_ns: 0 for a latched message, which may come
    later."""

    log_time_ns: int
    publish_time_ns: int
    sequence: int
    digest: bytes


class Copies(BagCheck):
    """Compares both bags in log-time order; only the messages of one instant are held in memory."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        untouched = sorted(attacked.clean.topics.keys() - attacked.replaced - set(attacked.cloud_topics))
        unexpected = attacked.adversarial.topics.keys() - attacked.clean.topics.keys() - attacked.replaced
        for name in sorted(unexpected):
            yield Fault(f"{self.bag.place} {name}", "is not a topic of the clean bag")
        self._latched = latched_topics(attacked.clean)
        counting = attacked.cloud_topics[:1]
        clean = attacked.kept(attacked.clean.raw_messages([*untouched, *counting]))
        expected = (raw for raw in clean if raw.topic.name not in counting)
        present = [name for name in untouched if name in attacked.adversarial.topics]
        yield from self._compare(expected, attacked.adversarial.raw_messages(present))

    def _compare(self, expected: Iterator[RawMessage], found: Iterator[RawMessage]) -> Iterator[Result]:
        waiting: dict[str, deque[_Copy]] = {}
        missing_counts: Counter[str] = Counter()
        following = next(expected, None)
        for raw in found:
            while following is not None and following.log_time_ns <= raw.log_time_ns:
                name, copy = following.topic.name, self._copy(following)
                queue = waiting.setdefault(name, deque())
                queue.append(copy)
                while queue and 0 < queue[0].log_time_ns < raw.log_time_ns:  # its time has passed
                    queue.popleft()
                    missing_counts[name] += 1
                following = next(expected, None)
            queue = waiting.setdefault(raw.topic.name, deque())
            copy, where = self._copy(raw), f"{self.bag.place} {raw.topic.name}"
            if not queue:
                yield Fault(where, f"the message at {raw.log_time_ns} ns is not in the clean bag")
            elif queue[0] == copy:
                queue.popleft()
            elif copy in queue:
                missing = queue.index(copy)
                yield Fault(where, f"{missing} messages of the clean bag are missing at {raw.log_time_ns} ns")
                for _ in range(missing + 1):
                    queue.popleft()
            else:
                queue.popleft()
                yield Fault(where, f"the message at {raw.log_time_ns} ns differs from the clean bag's")
        while following is not None:
            missing_counts[following.topic.name] += 1
            following = next(expected, None)
        missing_counts.update({name: len(queue) for name, queue in waiting.items()})
        for name, count in sorted(missing_counts.items()):
            if count:
                yield Fault(f"{self.bag.place} {name}", f"{count} messages of the clean bag are missing")

    def _copy(self, raw: RawMessage) -> _Copy:
        digest = hashlib.blake2b(raw.cdr, digest_size=16).digest()
        time_ns = 0 if raw.topic.name in self._latched else raw.log_time_ns
        return _Copy(time_ns, raw.publish_time_ns, raw.sequence, digest)
