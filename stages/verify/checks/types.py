"""Whether the definitions of types are the known ones, and every message is one of its type."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.types import schema_text, type_hash
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import Bag


class Types(MessageCheck):
    """In advpipe's own bags, definitions are ours to the byte; elsewhere, by their RIHS01 hash (REP-2011)."""

    def __init__(self, bag: Bag) -> None:
        super().__init__(bag)
        self._known: set[str] = set()
        self._of_others: set[str] = set()

    def see(self, seen: MessageView) -> Iterator[Result]:
        if seen.raw.topic.name not in self._known:
            self._known.add(seen.raw.topic.name)
            yield from self._definition(seen)
        if seen.message is None and seen.raw.topic.name not in self._of_others:
            yield Fault(seen.where, seen.error)

    def check(self) -> Iterator[Result]:
        return iter(())

    def _definition(self, seen: MessageView) -> Iterator[Result]:
        raw, name = seen.raw, seen.raw.topic.type
        try:
            expected, text = type_hash(name), schema_text(name)
        except Exception:  # rosbags raises many things for a name that it does not know
            expected, text = "", ""
        if expected and self.bag.is_own:
            if raw.schema != text:
                yield Fault(seen.where, f"defines {name} differently from advpipe")
            elif raw.topic.type_hash not in ("", expected):
                yield Fault(seen.where, f"states a type hash that is not that of {name}")
            return
        try:
            real = self.bag.reader.type_hash(raw)
        except AdvpipeError as error:
            self._of_others.add(raw.topic.name)
            said = Unchecked if expected and not self.bag.provenance else Fault
            yield said(seen.where, f"messages cannot be read: {error}")
            return
        if raw.topic.type_hash not in ("", real):
            yield Fault(seen.where, f"states a type hash that does not match its definition of {name}")
        if not expected:
            yield Unchecked(
                seen.where, f"advpipe does not know the type {name}; the bag's definition is used"
            )
        elif real != expected:
            yield Unchecked(seen.where, f"its definition of {name} comes from another release")
