"""Whether each adversarial bag was made from the clean one next to it."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked


class ProvenanceCheck(BagCheck):
    """Checks the provenance record, and the parent's SHA-256 in it."""

    def check(self) -> Iterator[Result]:
        bag = self.bag
        if not bag.provenance:
            yield Unchecked(bag.place, "another tool's bag: it does not record its origin")
            return
        if not bag.is_attack:
            return
        if bag.parent is None and any(candidate.sha256 is None for candidate in bag.subject.candidates):
            yield Unchecked(
                bag.place, "its possible parent bag cannot be read, so the attack is verified alone"
            )
        elif bag.parent is None and bag.subject.layout is not None:
            yield Fault(bag.place, "was not made from this data set's bag (parent_sha256)")
        elif bag.parent is None:
            yield Unchecked(bag.place, "its parent bag is not here, so the attack is verified alone")
        elif bag.parent.provenance.fields.scenario != bag.provenance.fields.scenario:
            yield Fault(bag.place, f"records a scenario that differs from its parent's ({bag.parent.place})")
