"""Whether type definitions match the known ones, and messages match their types."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.types import schema_text, type_hash
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import BagUnderTest


class Types(MessageCheck):
    """Compares definitions byte for byte in advpipe's bags, and by their RIHS01 hash (REP-2011) in others."""

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._checked_topics: set[str] = set()
        self._unreadable: set[str] = set()

    def see(self, view: MessageView) -> Iterator[Result]:
        if view.raw.topic.name not in self._checked_topics:
            self._checked_topics.add(view.raw.topic.name)
            yield from self._definition(view)
        if view.message is None and view.raw.topic.name not in self._unreadable:
            yield Fault(view.where, view.error)

    def check(self) -> Iterator[Result]:
        return iter(())

    def _definition(self, view: MessageView) -> Iterator[Result]:
        raw, name = view.raw, view.raw.topic.type
        try:
            expected, text = type_hash(name), schema_text(name)
        except Exception:  # rosbags raises many exceptions for an unknown name
            expected, text = "", ""
        if expected and self.bag.is_own:
            if raw.schema != text:
                yield Fault(view.where, f"defines {name} differently from advpipe")
            elif raw.topic.type_hash not in ("", expected):
                yield Fault(view.where, f"states a type hash that does not match {name}")
            return
        try:
            real = self.bag.reader.type_hash(raw)
        except AdvpipeError as error:
            self._unreadable.add(raw.topic.name)
            result_type = Unchecked if expected and not self.bag.provenance else Fault
            yield result_type(view.where, f"messages cannot be read: {error}")
            return
        if raw.topic.type_hash not in ("", real):
            yield Fault(view.where, f"states a type hash that does not match its definition of {name}")
        if not expected:
            yield Unchecked(
                view.where, f"advpipe does not know the type {name}; the bag's definition is used"
            )
        elif real != expected:
            yield Unchecked(view.where, f"its definition of {name} comes from another release")
