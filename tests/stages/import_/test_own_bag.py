"""A bag of advpipe that was imported, imported once more as a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from advpipe.pipeline.bag.frame_names import read_frame_names
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.inspect import UncountedLabels, describe
from tests.stages.import_.importing import import_form
from tests.stages.import_.kitti.kitti_folders import write_object_frames

SAMPLE = Path(__file__).parents[3] / "sample" / "clean"


def test_a_bag_that_was_imported_before_keeps_what_it_says_beyond_other_recordings(tmp_path: Path) -> None:
    """Regions, objects that count neither way, names of frames, and the licence."""
    kitti = write_object_frames(tmp_path / "kitti")
    first = import_form("kitti", kitti, tmp_path / "first", licence="MIT")
    again = import_form("rosbag", first.bag, tmp_path / "again")
    assert again.licence == "MIT"
    assert again.counts == first.counts
    source = yaml.safe_load((tmp_path / "again" / "source.yaml").read_text())
    assert source["citation"].startswith("A. Geiger")
    for one, two in zip(read_frames(first.bag), read_frames(again.bag), strict=True):
        assert np.allclose(one.boxes.geometry, two.boxes.geometry, rtol=0, atol=1e-12)
        before, after = one.uncounted, two.uncounted
        assert after.boxes.class_names == before.boxes.class_names == ("Van",)
        assert np.allclose(after.boxes.geometry, before.boxes.geometry, rtol=0, atol=1e-12)
        assert [each.name for each in after.coverage.labelled] == ["camera_2"]
        for name in ("labelled", "ignored"):
            ours, theirs = getattr(after.coverage, name), getattr(before.coverage, name)
            assert len(ours) == len(theirs) == 1
            assert np.allclose(ours[0].planes, theirs[0].planes, rtol=0, atol=1e-12)
    names = read_frame_names(again.bag)
    assert [names.of(frame.stamp_ns, 0) for frame in read_frames(again.bag)] == ["000003", "000007"]
    (left_out,) = (note for note in again.notes if note.startswith("Left out: "))
    assert "/ego/camera_0/camera_info" in left_out
    counted = import_form("rosbag", first.bag, tmp_path / "van", classes={"Van": "truck"}).counts
    assert (counted.objects, counted.ignored) == (first.counts.objects + 2, 0)


def test_inspect_counts_what_counts_neither_way(tmp_path: Path) -> None:
    bag = import_form("kitti", write_object_frames(tmp_path / "kitti"), tmp_path / "d").bag
    found = describe(bag)
    assert found.uncounted == UncountedLabels({"Van": 2}, regions=2, partial=2)
    assert found.uncounted.lines()[0] == ("ignored", "2 boxes (Van 2)")
    assert [(each.class_name, each.boxes) for each in found.objects] == [("car", 2)]
    assert not describe(SAMPLE).uncounted
