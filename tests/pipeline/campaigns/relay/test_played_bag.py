"""A relay's recording, completed with the bag that was played."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.campaigns.relay.played_bag import CLOUDS, FIXES, PlayedBag, topics_of_v2x
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.labels.clouds import LabelledFrame, PointTables
from advpipe.pipeline.labels.fixes import FILE as FIX_LABELS
from advpipe.pipeline.labels.fixes import FIX_COLUMNS
from advpipe.pipeline.labels.growing_table import GrowingTable
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.messages.cloud import cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

EGO = VehicleTopics()
CLEAN = shipped_sample() / "clean"
LATER_NS = 30_000_000
STAMPED = {CLOUDS: EGO.lidar_points.name, FIXES: EGO.gnss_fix.name}


def record(folder: Path, shift_ns: int = 0) -> Path:
    """What a relay records that missed the first cloud: ten points fewer each, 30 ms later."""
    reader = BagReader(CLEAN)
    with BagWriter(folder, provenance={"kind": "attack", "attack": "detach"}) as bag:
        with PointTables(bag.folder) as tables:
            for number, raw in enumerate(list(reader.raw_messages([EGO.lidar_points.name]))[1:]):
                stamped = reader.cloud(raw)
                labels = PointLabels.removed(np.arange(10))
                tables.add(LabelledFrame(raw.topic.name, number, "detach", stamped, 1), labels)
                cdr = cloud_to_cdr(stamped.cloud[10:], stamped.stamp_ns + shift_ns, stamped.frame_id)
                bag.write_cdr(EGO.lidar_points, cdr, raw.log_time_ns + LATER_NS)
        fixes = GrowingTable(bag.folder / FIX_LABELS, FIX_COLUMNS)
        for number, (_, fix) in enumerate(list(reader.messages(EGO.gnss_fix.name))[1:]):
            stamp_ns = fix.header.stamp.sec * 10**9 + fix.header.stamp.nanosec
            fixes.add_row({"vehicle": "ego", "fix": number, "stamp_ns": stamp_ns, "mattered": False})
        for raw in list(reader.raw_messages([EGO.gnss_fix.name]))[1:]:
            bag.write_cdr(EGO.gnss_fix, raw.cdr, raw.log_time_ns + LATER_NS)
        fixes.close()
    return folder


def complete(recorded: Path) -> None:
    PlayedBag(CLEAN).complete(recorded, STAMPED, topics_of_v2x("ego"), lambda folder: None)


def test_times_numbers_and_topics_are_those_of_the_played_bag(tmp_path: Path) -> None:
    complete(recorded := record(tmp_path / "live"))
    clean, live = BagReader(CLEAN), BagReader(recorded)
    for name in STAMPED.values():
        assert live.log_times_ns(name).tolist() == clean.log_times_ns(name).tolist()[1:]
    before, after = (
        [reader.cloud(raw) for raw in reader.raw_messages([EGO.lidar_points.name])]
        for reader in (clean, live)
    )
    assert [cloud.cloud.tobytes() for cloud in after] == [cloud.cloud[10:].tobytes() for cloud in before[1:]]
    assert pq.read_table(recorded / "frames.parquet")["frame"].to_pylist() == [1, 2]
    assert pq.read_table(recorded / "labels.parquet")["frame"].to_pylist() == [1] * 10 + [2] * 10
    assert pq.read_table(recorded / FIX_LABELS)["fix"].to_pylist() == list(
        range(1, clean.topics[EGO.gnss_fix.name].count)
    )
    assert live.provenance["parent_sha256"] == parent_sha256(CLEAN)
    assert live.provenance["scenario"] == clean.provenance["scenario"]
    assert clean.topics.keys() - live.topics.keys() == {*topics_of_v2x("ego")} & clean.topics.keys()
    others = live.topics.keys() - STAMPED.values()
    sent = [(raw.topic.name, raw.log_time_ns, raw.cdr) for raw in clean.raw_messages(others)]
    assert sorted(sent) == sorted(
        (raw.topic.name, raw.log_time_ns, raw.cdr) for raw in live.raw_messages(others)
    )
    times_ns = [raw.log_time_ns for raw in live.raw_messages()]
    assert times_ns == sorted(times_ns)


def test_another_bag_was_played(tmp_path: Path) -> None:
    recorded = record(tmp_path / "live", shift_ns=5)
    before = (recorded / "live_0.mcap").read_bytes()
    with pytest.raises(AdvpipeError, match=r"lacks a message of \d+ ns on /ego/lidar/points") as found:
        complete(recorded)
    assert "\n" not in str(found.value)
    assert (recorded / "live_0.mcap").read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"live"}


def test_an_adversarial_bag_is_refused(tmp_path: Path) -> None:
    recorded = record(tmp_path / "live")
    with pytest.raises(UsageError, match="is an adversarial bag; name the clean bag that is played"):
        PlayedBag(recorded)
