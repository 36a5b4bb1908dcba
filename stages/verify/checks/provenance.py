"""Whether each adversarial bag was made from the clean one that lies beside it."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Gap, Result


class ProvenanceCheck(BagCheck):
    """The record in the bag, and the chain of SHA-256 from child to parent."""

    def check(self) -> Iterator[Result]:
        bag = self.bag
        if not bag.provenance:
            yield Gap(bag.place, "another tool's bag: it does not say where it comes from")
            return
        if not bag.is_attack:
            return
        if bag.parent is None and any(one.sha256 is None for one in bag.subject.candidates):
            yield Gap(bag.place, "the bag that it may be made from cannot be read: it is verified alone")
        elif bag.parent is None and bag.subject.layout is not None:
            yield Fault(bag.place, "was made from a bag that is not the one in this data set (parent_sha256)")
        elif bag.parent is None:
            yield Gap(bag.place, "the bag that it was made from is not here: the attack is verified alone")
        elif bag.parent.provenance.said.scenario != bag.provenance.said.scenario:
            yield Fault(bag.place, f"tells another scenario than its parent {bag.parent.place}")
