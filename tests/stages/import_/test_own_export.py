"""An export of advpipe that is imported again: its licence, and classes that the form does not know."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.stages.export.run import export_bags
from tests.stages.import_.av2.tiny_av2 import write_av2
from tests.stages.import_.importing import import_form
from tests.stages.import_.kitti.kitti_folders import CAR, write_object_frames, write_text

SAMPLE = Path(__file__).parents[3] / "sample"


def said(data_set: Path) -> tuple[str | None, str]:
    source = yaml.safe_load((data_set / "source.yaml").read_text(encoding="utf-8"))
    return source["licence"], source["citation"]


@pytest.mark.parametrize(("form", "place"), [("openpcdet", "clean"), ("kitti", "clean/training")])
def test_what_counts_neither_way_comes_back(tmp_path, form, place):
    first = import_form("av2", write_av2(tmp_path / "log"), tmp_path / "d")
    export_bags(first.data_set, form, tmp_path / "out")
    again = import_form(form, tmp_path / "out" / place, tmp_path / "back")
    assert again.counts.ignored > 0
    before = {name for frame in read_frames(first.bag) for name in frame.uncounted.boxes.class_names}
    after = {name for frame in read_frames(again.bag) for name in frame.uncounted.boxes.class_names}
    assert after <= before
    if form == "openpcdet":  # KITTI's form leaves out what the picture does not show
        assert (again.counts.objects, again.counts.ignored) == (first.counts.objects, first.counts.ignored)
    assert said(again.data_set) == said(first.data_set)
    assert not any("The licence is that of the data published as" in note for note in again.notes)


def test_classes_of_the_first_import_are_taken_again(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    write_text(root / "training" / "label_2" / "000003.txt", CAR.replace("Car", "Tractor") + "\n")
    first = import_form("kitti", root, tmp_path / "d", classes={"Tractor": "truck"}, licence="MIT")
    export_bags(first.data_set, "kitti", tmp_path / "out")
    again = import_form("kitti", tmp_path / "out" / "clean", tmp_path / "back")
    assert next(read_frames(again.bag)).boxes.labels.tolist() == [1]
    assert said(again.data_set)[0] == "MIT"


def test_a_simulated_drive_does_not_get_the_licence_of_the_form(tmp_path):
    export_bags(SAMPLE / "clean", "kitti", tmp_path / "out")
    back = import_form("kitti", tmp_path / "out" / "clean", tmp_path / "back")
    assert said(back.data_set) == (None, "")
    chosen = import_form("kitti", tmp_path / "out" / "clean", tmp_path / "chosen", licence="CC0-1.0")
    assert said(chosen.data_set)[0] == "CC0-1.0"
