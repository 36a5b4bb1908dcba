"""Whether the frames are one tree, in which the frame of every message is found."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.messages.topics import TF, TF_STATIC, VehicleTopics
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import Bag

_ODOMETRY = VehicleTopics().odometry.type


class Transforms(MessageCheck):
    """/tf and /tf_static. Odometry ties its two frames likewise: that of the wheels has its own."""

    def __init__(self, bag: Bag) -> None:
        super().__init__(bag)
        self._parents: dict[str, str] = {}
        self._ties: set[tuple[str, str]] = set()
        self._used: dict[tuple[str, str], None] = {}

    def see(self, seen: MessageView) -> Iterator[Result]:
        if seen.message is None:
            return
        if seen.raw.topic.name in (TF.name, TF_STATIC.name):
            for transform in seen.message.transforms:
                parent, child = transform.header.frame_id, transform.child_frame_id
                if self._parents.setdefault(child, parent) != parent:
                    yield Fault(seen.where, f"{child} has two parents, {self._parents[child]} and {parent}")
        elif seen.header is not None and seen.header.frame_id:
            self._used[seen.raw.topic.name, seen.header.frame_id] = None
            if seen.raw.topic.type == _ODOMETRY:
                self._ties.add((seen.header.frame_id, seen.message.child_frame_id))

    def check(self) -> Iterator[Result]:
        where = self.bag.place
        if not self._parents:
            if self._used:
                yield Unchecked(where, "no transforms: its frames are not connected")
            return
        frames = {*self._parents, *self._parents.values()}
        roots = sorted(frame for frame in frames if frame not in self._parents)
        if len(roots) != 1:
            found = f"has several roots: {', '.join(roots)}" if roots else "forms a cycle"
            yield Fault(where, f"the transform tree {found}")
        elif loose := sorted(frames - self._below(roots[0])):
            yield Fault(where, f"the frames {', '.join(loose)} form a cycle")
        tied = {parent for parent, child in self._ties if child in frames}
        tied |= {child for parent, child in self._ties if parent in frames}
        for topic, frame in self._used:
            if frame not in frames | tied:
                yield Fault(f"{where} {topic}", f"no transform contains its frame {frame!r}")

    def _below(self, root: str) -> set[str]:
        """The root and all frames that hang from it."""
        children: dict[str, list[str]] = {}
        for child, parent in self._parents.items():
            children.setdefault(parent, []).append(child)
        found, waiting = set[str](), [root]
        while waiting:
            frame = waiting.pop()
            found.add(frame)
            waiting += children.get(frame, [])
        return found
