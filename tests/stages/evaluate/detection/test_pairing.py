"""Frames of two bags belong together by their stamps, and each is read alone."""

import pytest
from place_drive import PERIOD_NS, clean_cloud, write_bag

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.evaluate.detection.pairing import NO_FRAME, FramePairs, PairReader, pair_frames

FRAMES = range(6)


@pytest.fixture
def drive(tmp_path):
    return write_bag(tmp_path / "clean", {}, {index: clean_cloud(index) for index in FRAMES})


def version(path, frames):
    return write_bag(path, {}, {index: clean_cloud(index) for index in frames})


def logged_late(path, stamps_ns, late_ns):
    """Clouds with these stamps, as a recorder of other software logs them some time later."""
    with BagWriter(path, provenance={}) as bag:
        for stamp_ns in stamps_ns:
            cdr = cloud_to_cdr(clean_cloud(0), stamp_ns, "ego/lidar")
            bag.write_cdr(VehicleTopics("ego").lidar_points, cdr, stamp_ns + late_ns)
    return path


def test_a_version_of_some_frames(drive, tmp_path):
    bag = version(tmp_path / "bag", [1, 4])
    assert pair_frames(drive, bag, FRAMES).tolist() == [NO_FRAME, 0, NO_FRAME, NO_FRAME, 1, NO_FRAME]
    assert pair_frames(drive, bag, [1, 4]).tolist() == [0, 1]
    assert pair_frames(drive, bag, [3, 4], is_part=True).tolist() == [NO_FRAME, 1]


def test_a_frame_that_was_not_chosen_is_foreign_unless_a_part_was_asked_for(drive, tmp_path):
    bag = version(tmp_path / "bag", [1, 4])
    with pytest.raises(AdvpipeError, match="made from another bag"):
        pair_frames(drive, bag, [1, 2])


def test_bags_of_another_recorder_pair_by_stamps(drive, tmp_path):
    first_ns = PairReader(FramePairs.of(drive, (), FRAMES)).frames(0)[0].stamp_ns
    stamps_ns = [first_ns + index * PERIOD_NS for index in (0, 2, 3)]
    bag = logged_late(tmp_path / "late", stamps_ns, late_ns=7_000_000)
    assert pair_frames(drive, bag, FRAMES).tolist() == [0, NO_FRAME, 1, 2, NO_FRAME, NO_FRAME]


def test_frames_of_several_bags_are_read_in_any_order(drive, tmp_path):
    bags = [version(tmp_path / "one", [1, 4]), version(tmp_path / "two", [4, 5])]
    pairs = FramePairs.of(drive, bags, FRAMES)
    assert pairs.chosen == (1, 4, 5)  # the others are in no bag
    reader = PairReader(pairs)
    for index, held in ((5, [False, True]), (1, [True, False]), (4, [True, True])):
        before, versions = reader.frames(index)
        assert before.index == index
        assert [version is not None for version in versions] == held
        assert all(each.stamp_ns == before.stamp_ns for each in versions if each)


def test_a_cloud_of_the_same_log_time_with_another_stamp_is_foreign(drive, tmp_path):
    first_ns = PairReader(FramePairs.of(drive, (), FRAMES)).frames(0)[0].stamp_ns
    bag = logged_late(tmp_path / "foreign", [first_ns - 5], late_ns=5)
    reader = PairReader(FramePairs.of(drive, [bag], FRAMES))
    with pytest.raises(AdvpipeError, match="made from another bag"):
        reader.frames(0)
