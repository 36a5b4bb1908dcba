"""Single frames of a bag in any order: the same as those that are read from front to back."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frame_reader import FrameReader
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.mcap.reader import McapFile
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

LIDAR = VehicleTopics("ego").lidar_points


def test_frames_in_any_order_are_those_of_the_bag(tmp_path: Path, record: Callable[..., Path]) -> None:
    bag = record(tmp_path / "bag", frames=7)
    reader = FrameReader(bag)
    whole = list(read_frames(bag))
    for index in (3, 6, 0, 1, 1, 5):
        frame = reader.frame(index)
        assert (frame.index, frame.stamp_ns) == (index, whole[index].stamp_ns)
        assert frame.cloud.tobytes() == whole[index].cloud.tobytes()
        assert (frame.boxes.geometry == whole[index].boxes.geometry).all()
        np.testing.assert_equal(frame.boxes.velocity_mps, whole[index].boxes.velocity_mps)
        assert frame.boxes.ids == whole[index].boxes.ids


def test_only_the_chunks_of_the_frame_are_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cloud fills a chunk of its own."""
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        for frame in range(20):
            bag.write_cdr(
                LIDAR, cloud_to_cdr(np.zeros(60_000, POINT_DTYPE), frame * 10**8, "l"), frame * 10**8
            )
    reader, unpacked = FrameReader(tmp_path / "bag"), []
    read = McapFile._messages_in
    monkeypatch.setattr(McapFile, "_messages_in", lambda *given: unpacked.append(1) or read(*given))
    for index in (17, 3):
        assert reader.frame(index).stamp_ns == index * 10**8
    assert len(unpacked) <= 4


def test_clouds_of_one_log_time_keep_their_numbers(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        for stamp_ns in (1, 2, 3):
            bag.write_cdr(LIDAR, cloud_to_cdr(np.zeros(stamp_ns, POINT_DTYPE), stamp_ns, "l"), 10**9)
    reader = FrameReader(tmp_path / "bag")
    assert [len(reader.frame(index).cloud) for index in (2, 0, 1)] == [3, 1, 2]


def test_a_bag_without_clouds_is_refused(tmp_path: Path, record: Callable[..., Path]) -> None:
    with pytest.raises(UsageError, match="has no clouds on /other"):
        FrameReader(record(tmp_path / "bag", frames=1), "/other")
    with pytest.raises(AdvpipeError, match="does not exist"):
        FrameReader(tmp_path / "nowhere")
