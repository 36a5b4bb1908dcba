"""A bag's properties as a contract for Backplane Tracecheck: `tracecheck check BAG --contract FILE`."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from advpipe.pipeline.bag.provenance import RECORD_NAME
from advpipe.stages.share.baglint_spec import SLACK
from advpipe.stages.share.facts import BagFacts, TopicFacts

MOST_TOPICS = 50
"""Tracecheck's limit for a contract; it has the first topics by name."""

_MOST_CHARACTERS = 256
_PROVENANCE_KEYS = ("kind", "scenario_name", "seed", "map_sha256", "parent_sha256", "attack", "recipe")


def tracecheck_contract(bag: BagFacts, name: str) -> str:
    """JSON in the form of tracecheck 0.3, version 1; name: of the recording.

    For each topic: type, definition, exact count, rate, gaps, first and last time; time never goes backwards.
    """
    document: dict[str, Any] = {"version": 1, "name": name[:_MOST_CHARACTERS], "profile": "ros2"}
    record = {
        key: bag.provenance[key]
        for key in _PROVENANCE_KEYS
        if 0 < len(bag.provenance.get(key, "")) <= _MOST_CHARACTERS
    }
    if record:
        document["metadata"] = {RECORD_NAME: record}
    topics = list(bag.topics.values())[:MOST_TOPICS]
    document["topics"] = {topic.name: _topic(topic) for topic in topics}
    return json.dumps(document, indent=1) + "\n"


def _topic(topic: TopicFacts) -> dict[str, Any]:
    """The contract of one topic, which has at least one message."""
    terms: dict[str, Any] = {
        "message_encoding": "cdr",
        "schema_name": topic.type,
        "schema_encoding": topic.schema_encoding,
        "schema_sha256": hashlib.sha256(topic.schema.encode()).hexdigest(),
        "min_count": topic.count,
        "max_count": topic.count,
        "clock_confirmed": True,
        "check_regression": True,
    }
    if topic.is_counted:
        terms["sequence"] = "increment_mod32"
    if topic.rate_hz is not None:
        terms["min_rate_hz"] = round(topic.rate_hz * (1 - SLACK), 6)
        terms["max_rate_hz"] = round(topic.rate_hz * (1 + SLACK), 6)
        terms["max_gap_ns"] = topic.max_gap_ns
        terms["interval_ns"] = [topic.first_ns, topic.last_ns]
    return terms
