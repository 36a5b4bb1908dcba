"""Changes of messages, with two small real ones; the bag's own order is the oracle."""

from __future__ import annotations

from dataclasses import replace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.stages.attack.change import changed_messages

ODOMETRY, BOXES = "/ego/ground_truth/odometry", "/ego/ground_truth/objects"
LATER_NS = 7_000_000


class Late:
    """Holds the messages of one topic back by 7 ms, and drops every second one."""

    def __init__(self, reader, topic):
        self.reader, self.topics = reader, frozenset({topic})

    def messages(self):
        for index, raw in enumerate(self.reader.raw_messages(self.topics)):
            if index % 2 == 0:
                yield replace(raw, log_time_ns=raw.log_time_ns + LATER_NS)

    def write_labels(self, folder):
        pq.write_table(pa.table({"topic": sorted(self.topics)}), str(folder / "late.parquet"))


class Same(Late):
    def messages(self):
        return self.reader.raw_messages(self.topics)


@pytest.fixture
def reader(clean_bag):
    return BagReader(clean_bag)


def test_without_a_change_the_bag_is_as_it_was(reader):
    assert list(changed_messages(reader, [])) == list(reader.raw_messages())


def test_a_change_that_changes_nothing_leaves_the_order_too(reader):
    assert list(changed_messages(reader, [Same(reader, ODOMETRY)])) == list(reader.raw_messages())
    several = [Same(reader, BOXES), Same(reader, ODOMETRY)]
    assert list(changed_messages(reader, several)) == list(reader.raw_messages())


def test_all_topics_may_be_replaced(reader):
    every = [Same(reader, topic) for topic in reader.topics]
    assert sorted(changed_messages(reader, every), key=repr) == sorted(reader.raw_messages(), key=repr)


def test_changed_messages_come_at_their_times_and_the_rest_is_untouched(reader):
    clean = list(reader.raw_messages())
    changed = list(changed_messages(reader, [Late(reader, ODOMETRY)]))
    times_ns = [raw.log_time_ns for raw in changed]
    assert times_ns == sorted(times_ns)
    assert [raw for raw in changed if raw.topic.name != ODOMETRY] == [
        raw for raw in clean if raw.topic.name != ODOMETRY
    ]
    before = [raw for raw in clean if raw.topic.name == ODOMETRY]
    after = [raw for raw in changed if raw.topic.name == ODOMETRY]
    assert len(after) == 3
    assert [raw.log_time_ns - LATER_NS for raw in after] == [raw.log_time_ns for raw in before[::2]]
    assert [raw.cdr for raw in after] == [raw.cdr for raw in before[::2]]
