"""Warnings to the author of a data set before it is published."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from advpipe.pipeline.dataset.layout import Layout
from advpipe.stages.share.facts import BagFacts
from advpipe.stages.share.options import ShareOptions
from advpipe.stages.share.tracecheck_contract import MOST_TOPICS

_PATH = re.compile(
    r"(?:^|[\s'\":=\[(,])((?:/(?:home|root|Users|mnt|media|tmp|data)/|[A-Za-z]:\\)[^\s'\",\])]*)"
)


def sharing_warnings(found: Layout, bags: Sequence[BagFacts], options: ShareOptions) -> Iterator[str]:
    """The warnings, one line each."""
    if options.licence is None:
        yield "no licence is stated, so no one may use the data set: give one, such as --licence CC-BY-4.0"
    if found.source is None and found.scenario is None:
        yield "there is no scenario.yaml: the drive cannot be simulated again"
    attacks = [facts.path for facts in bags if facts.is_attack]
    if not attacks:
        yield "there is no adversarial bag"
    for bag in attacks:
        if not (bag / "attack.yaml").is_file():
            yield f"{bag.name} has no attack.yaml: only the bag's provenance records the attack"
    for facts in bags:
        if not facts.description.checksums.chunks_covered:
            yield f"{facts.path.name} has no chunk checksums; only SHA256SUMS reveals damage"
        if len(facts.topics) > MOST_TOPICS:
            yield f"{facts.path.name} has {len(facts.topics)} topics; its contract holds {MOST_TOPICS}"
    paths = {match for facts in bags for match in _PATH.findall(" ".join(facts.provenance.values()))}
    if paths:
        yield f"the bags' provenance records hold paths of the machine that made them, such as {min(paths)}"
