"""Whether the frames form one tree that contains the frame of every message."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.messages.topics import TF, TF_STATIC, VehicleTopics
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import BagUnderTest

_ODOMETRY = VehicleTopics().odometry.type


class Transforms(MessageCheck):
    """Checks /tf and /tf_static. Odometry also connects its two frames; wheel odometry has its own frame."""

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._parents: dict[str, str] = {}
        self._odometry_pairs: set[tuple[str, str]] = set()
        self._message_frames: dict[tuple[str, str], None] = {}

    def see(self, view: MessageView) -> Iterator[Result]:
        if view.message is None:
            return
        if view.raw.topic.name in (TF.name, TF_STATIC.name):
            for transform in view.message.transforms:
                parent, child = transform.header.frame_id, transform.child_frame_id
                if self._parents.setdefault(child, parent) != parent:
                    yield Fault(view.where, f"{child} has two parents, {self._parents[child]} and {parent}")
        elif view.header is not None and view.header.frame_id:
            self._message_frames[view.raw.topic.name, view.header.frame_id] = None
            if view.raw.topic.type == _ODOMETRY:
                self._odometry_pairs.add((view.header.frame_id, view.message.child_frame_id))

    def check(self) -> Iterator[Result]:
        where = self.bag.place
        if not self._parents:
            if self._message_frames:
                yield Unchecked(where, "no transforms: its frames are not connected")
            return
        frames = {*self._parents, *self._parents.values()}
        roots = sorted(frame for frame in frames if frame not in self._parents)
        if len(roots) != 1:
            found = f"has several roots: {', '.join(roots)}" if roots else "forms a cycle"
            yield Fault(where, f"the transform tree {found}")
        elif loose := sorted(frames - self._below(roots[0])):
            yield Fault(where, f"the frames {', '.join(loose)} form a cycle")
        connected = {parent for parent, child in self._odometry_pairs if child in frames}
        connected |= {child for parent, child in self._odometry_pairs if parent in frames}
        for topic, frame in self._message_frames:
            if frame not in frames | connected:
                yield Fault(f"{where} {topic}", f"no transform contains its frame {frame!r}")

    def _below(self, root: str) -> set[str]:
        """The root and all frames below it."""
        children: dict[str, list[str]] = {}
        for child, parent in self._parents.items():
            children.setdefault(parent, []).append(child)
        found, waiting = set[str](), [root]
        while waiting:
            frame = waiting.pop()
            found.add(frame)
            waiting += children.get(frame, [])
        return found
