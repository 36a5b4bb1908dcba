"""A bag's properties as a specification for baglint: `baglint --strict BAG.mcap --spec FILE` checks it."""

from __future__ import annotations

from typing import Any

import yaml

from advpipe.stages.share.facts import BagFacts, TopicFacts, TransformSpan

SLACK = 0.01
"""Relative margin of the bounds around the recorded values, for rounding."""

_FEWEST_FOR_A_RATE = 10
_LEAST_STALE_MS = 500.0  # baglint's default


def baglint_spec(bag: BagFacts) -> str:
    """YAML in the form of baglint 0.2: topics with rates, gaps and stamps, and the frames they need."""
    pairs, stale_ms = _transforms(bag)
    document: dict[str, Any] = {"topics": {name: _topic(topic) for name, topic in bag.topics.items()}}
    if pairs:
        document["transforms"] = {"required": [list(pair) for pair in pairs], "max_stale_ms": stale_ms}
    return yaml.safe_dump(document, sort_keys=False, allow_unicode=True)


def _topic(topic: TopicFacts) -> dict[str, Any]:
    spec: dict[str, Any] = {}
    if topic.rate_hz is not None and topic.count >= _FEWEST_FOR_A_RATE:
        spec["min_rate"] = round(topic.rate_hz * (1 - SLACK), 3)
        spec["max_gap_ms"] = round(topic.max_gap_ns / 1e6 * (1 + SLACK) + 0.001, 3)
    if topic.has_good_stamps:
        spec["check_stamps"] = True
    return spec


def _transforms(bag: BagFacts) -> tuple[list[tuple[str, str]], float]:
    """Pairs of the root and each leaf connected throughout the bag, and the greatest age of a transform in
    ms."""
    spans = [(topic.first_ns, topic.last_ns) for topic in bag.topics.values() if topic.count]
    if not spans:
        return [], 0.0
    start_ns, end_ns = min(first for first, _ in spans), max(last for _, last in spans)
    longest_ns = max(
        (
            max(edge.max_gap_ns, end_ns - edge.last_ns)
            for edge in bag.transforms.values()
            if not edge.is_static
        ),
        default=0,
    )
    stale_ms = max(_LEAST_STALE_MS, round(longest_ns / 1e6 * (1 + SLACK) + 0.001, 3))
    above = {child: (parent, edge) for (parent, child), edge in bag.transforms.items()}
    leaves = sorted(set(above) - {parent for parent, _ in bag.transforms})
    return [
        (bag.root_frame, leaf) for leaf in leaves if _is_connected(above, leaf, bag.root_frame, start_ns)
    ], stale_ms


def _is_connected(above: dict[str, tuple[str, TransformSpan]], frame: str, root: str, start_ns: int) -> bool:
    """Whether a path leads up to the root from the bag's start on."""
    for _ in range(len(above) + 1):  # a tree has no longer path; a loop ends here
        if frame == root:
            return True
        if frame not in above:
            return False
        frame, edge = above[frame]
        if not edge.is_static and edge.first_ns > start_ns:
            return False
    return False
