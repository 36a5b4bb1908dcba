"""Whether the definitions of types are the known ones, and every message is one of its type."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.types import schema_text, type_hash
from advpipe.stages.verify.checks.base import MessageCheck, Seen
from advpipe.stages.verify.result import Fault, Gap, Result
from advpipe.stages.verify.subject import Bag


class Types(MessageCheck):
    """In advpipe's own bags, definitions are ours to the byte; elsewhere, by their RIHS01 hash (REP-2011)."""

    def __init__(self, bag: Bag) -> None:
        super().__init__(bag)
        self._known: set[str] = set()
        self._of_others: set[str] = set()

    def see(self, seen: Seen) -> Iterator[Result]:
        if seen.raw.topic.name not in self._known:
            self._known.add(seen.raw.topic.name)
            yield from self._definition(seen)
        if seen.message is None and seen.raw.topic.name not in self._of_others:
            yield Fault(seen.where, seen.error)

    def check(self) -> Iterator[Result]:
        return iter(())

    def _definition(self, seen: Seen) -> Iterator[Result]:
        raw, name = seen.raw, seen.raw.topic.type
        try:
            expected, text = type_hash(name), schema_text(name)
        except Exception:  # rosbags raises many things for a name that it does not know
            expected, text = "", ""
        if expected and self.bag.is_own:
            if raw.schema != text:
                yield Fault(seen.where, f"has another definition of {name} than advpipe writes")
            elif raw.topic.type_hash not in ("", expected):
                yield Fault(seen.where, f"states another type hash than {name} has")
            return
        try:
            real = self.bag.reader.type_hash(raw)
        except AdvpipeError as error:
            self._of_others.add(raw.topic.name)
            said = Gap if expected and not self.bag.provenance else Fault
            yield said(seen.where, f"messages cannot be read: {error}")
            return
        if raw.topic.type_hash not in ("", real):
            yield Fault(seen.where, f"states another type hash than its definition of {name} has")
        if not expected:
            yield Gap(seen.where, f"{name} is no type that advpipe knows; its definition is taken as it is")
        elif real != expected:
            yield Gap(seen.where, f"its definition of {name} is another release's")
