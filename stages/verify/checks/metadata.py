"""Whether metadata.yaml describes the messages in the bag."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from advpipe.pipeline.bag.files import METADATA_NAME, read_information
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.qos import qos_from_yaml
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.mcap_scanner import McapScanner
from advpipe.stages.verify.result import Fault, Result, Unchecked

_ERRORS = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
"""The exceptions of reading a document with another structure."""


class MetadataYaml(BagCheck):
    """Checks files, counts, times, types and QoS. `FilesBeside` compares the file with its copy in the
    bag."""

    def check(self) -> Iterator[Result]:
        path = self.bag.path / METADATA_NAME
        where = self.bag.subject.place(path)
        if self.bag.path.is_file():
            yield Unchecked(where, "does not exist for a single .mcap file")
            return
        try:
            information = read_information(path)
        except AdvpipeError as error:
            yield Fault(where, str(error))
            return
        scanners = self.bag.scanners
        try:
            for fault in _differences(information, scanners):
                yield Fault(where, fault)
        except _ERRORS:
            yield Fault(where, "is not rosbag2 metadata of a known version")
        listed = {scanner.path.name for scanner in scanners}
        for file in sorted(self.bag.path.glob("*.mcap")):
            if file.name not in listed:
                yield Fault(self.bag.subject.place(file), f"is not listed in {METADATA_NAME}")


def _differences(information: dict[str, Any], scanners: list[McapScanner]) -> Iterator[str]:
    if not 4 <= information["version"] <= 9:
        yield f"has the unknown version {information['version']}"
    yield from _span("", information, scanners)
    names = information["relative_file_paths"]
    for entry in information.get("files") or []:
        parts = [scanner for scanner in scanners if scanner.path.name == entry["path"]]
        if entry["path"] not in names or not parts:
            yield f"describes the file {entry['path']!r}, which it does not list"
        else:
            yield from _span(f"for {entry['path']}, ", entry, parts)
    stated = {entry["topic_metadata"]["name"]: entry for entry in information["topics_with_message_count"]}
    real = {topic.name: topic for scanner in scanners for topic in scanner.topics.values()}
    for name in sorted(stated.keys() ^ real.keys()):
        if name in real or stated[name]["message_count"]:
            yield f"{name} is {'not listed' if name in real else 'listed, but not in the bag'}"
    for name in sorted(stated.keys() & real.keys()):
        topic, entry = stated[name]["topic_metadata"], stated[name]
        count = sum(_count(scanner, name) for scanner in scanners)
        if entry["message_count"] != count:
            yield f"{name}: states {entry['message_count']} messages, but there are {count}"
        if topic["type"] != real[name].type:
            yield f"{name}: states the type {topic['type']}, but the bag has {real[name].type}"
        profiles = topic["offered_qos_profiles"]
        text = profiles if isinstance(profiles, str) else yaml.safe_dump(profiles)
        if qos_from_yaml(text) != real[name].qos:
            yield f"{name}: states a QoS that differs from the bag's"


def _count(scanner: McapScanner, name: str) -> int:
    return sum(count for channel, count in scanner.counts.items() if scanner.topics[channel].name == name)


def _span(prefix: str, stated: dict[str, Any], scanners: list[McapScanner]) -> Iterator[str]:
    """Count and times of some files together."""
    count = sum(sum(scanner.counts.values()) for scanner in scanners)
    if stated["message_count"] != count:
        yield f"{prefix}states {stated['message_count']} messages, but there are {count}"
    firsts = [scanner.first_ns for scanner in scanners if scanner.first_ns is not None]
    lasts = [scanner.last_ns for scanner in scanners if scanner.last_ns is not None]
    if not firsts:
        return
    if stated["starting_time"]["nanoseconds_since_epoch"] != min(firsts):
        yield f"{prefix}states a start that differs from the first message's, {min(firsts)} ns"
    if (
        abs(stated["duration"]["nanoseconds"] - (max(lasts) - min(firsts))) > 1
    ):  # some recorders include the end
        yield f"{prefix}states a duration that differs from the messages', {max(lasts) - min(firsts)} ns"
