"""Importing: what a form says is what the bag says, checked, the same bytes also after a killed run."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.core.option_names import use_flags
from advpipe.stages.evaluate.detection.scoring import Detections, Range, ground_truth, match
from advpipe.stages.import_ import registry, run
from advpipe.stages.import_.counts import FrameCounts
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from advpipe.stages.verify.run import verify
from tests.stages.import_ import tiny_form
from tests.stages.import_.tiny_form import TinyDrive, TinyForm, a_cloud, a_frame, some_boxes

EVERYWHERE = Range(-50, -50, -3, 50, 50, 1)


@pytest.fixture
def drive(monkeypatch: pytest.MonkeyPatch) -> TinyDrive:
    drive = TinyDrive()
    monkeypatch.setattr(tiny_form, "DRIVE", drive)
    monkeypatch.setattr(registry, "FORMS", {"tiny": TinyForm()})
    return drive


def imported(out: Path, **options) -> run.ImportSummary:
    overwrite = options.pop("overwrite", False)
    return import_drive(
        ImportRequest("tiny", Path(__file__).parent, ImportOptions(**options)), out, overwrite=overwrite
    )


def digest(bag: Path) -> str:
    return hashlib.sha256((bag / "clean_0.mcap").read_bytes()).hexdigest()


def test_clouds_and_boxes_come_back_as_the_source_gave_them(drive, tmp_path):
    summary = imported(tmp_path / "d")
    assert summary.frames == 3
    assert summary.counts == FrameCounts(clouds=3, points=1200, objects=9, ignored=3)
    frames = list(read_frames(summary.bag))
    for index, frame in enumerate(frames):
        assert frame.stamp_ns == (index + 1) * tiny_form.STEP_NS
        assert frame.cloud.tobytes() == a_cloud(index).tobytes()
        # a yaw passes through a quaternion, and may differ by a rounding
        assert np.allclose(frame.boxes.geometry, some_boxes(10.0, 20.0, -10.0).geometry, rtol=0, atol=1e-15)
        assert frame.uncounted.boxes.class_names == ("Van",)
    assert not verify(tmp_path / "d").findings


def test_what_counts_neither_way_is_no_false_positive(drive, tmp_path):
    frame = next(read_frames(imported(tmp_path / "d").bag))
    truth = ground_truth(frame, ("car",), EVERYWHERE)
    assert truth.is_evaluated.tolist() == [True, True, True]
    found = some_boxes(10.0, 15.0, -10.0, -14.0, 25.0).geometry
    detections = Detections(found, np.linspace(0.9, 0.5, 5), np.zeros(5, np.int64))
    frame_matches = match(truth, detections, ("car",))["strict", "car"]
    # what is labelled counts, also behind the vehicle, where labels are not complete
    assert frame_matches.is_true_positive.tolist() == [True, False, True, False, False]
    assert frame_matches.is_ignored.tolist() == [False, True, False, True, False]  # the van, nothing behind


def test_the_source_is_told_with_its_licence(drive, tmp_path):
    summary = imported(tmp_path / "d", frames="0:2")
    source = yaml.safe_load((tmp_path / "d" / "source.yaml").read_text())
    assert source["licence"] == summary.licence == "CC0-1.0"
    assert source["options"] == {"frames": "0:2"}
    assert BagReader(summary.bag).provenance["source"] == (tmp_path / "d" / "source.yaml").read_text()
    assert imported(tmp_path / "own", licence="LicenseRef-mine").licence == "LicenseRef-mine"


def test_a_killed_import_leaves_nothing_and_resumes_to_the_same_bytes(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "PART_FRAMES", 2)
    drive.count = 7
    whole = digest(imported(tmp_path / "whole").bag)
    drive.read.clear()
    drive.fails_at = 5
    with pytest.raises(RuntimeError):
        imported(tmp_path / "d")
    assert not (tmp_path / "d").exists()
    drive.fails_at = None
    drive.read.clear()
    assert digest(imported(tmp_path / "d").bag) == whole
    assert drive.read == [3, 4, 5, 6]  # the last finished one again, for the checks
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "whole"]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"stamp_ns": 1}, "is not after"),
        ({"map_SE3_base": np.diag([1.0, 1.0, -1.0, 1.0])}, "not a rotation"),
        (
            {"map_SE3_base": np.array([[1, 0, 0, 90.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])},
            "jumps 90.0 m",
        ),
        ({"clouds": {"lidar": a_cloud(1)[:0]}}, "has no points"),
        ({"boxes": some_boxes(np.nan)}, "not finite"),
    ],
)
def test_what_cannot_be_right_is_refused_in_one_line(drive, tmp_path, change, complaint):
    drive.changes[1] = a_frame(1, **change)
    with pytest.raises(AdvpipeError, match=complaint) as error:
        imported(tmp_path / "d")
    assert str(error.value).startswith("frame 1: ")
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_millimetres_are_refused_and_other_scales_of_intensity_noticed(drive, tmp_path):
    far, bright = a_cloud(1).copy(), a_cloud(2).copy()
    for axis in "xyz":
        far[axis] *= 1000
    bright["intensity"] *= 255
    drive.changes[2] = a_frame(2, clouds={"lidar": bright})
    assert any("--scale-intensity" in note for note in imported(tmp_path / "bright").notes)
    drive.changes[1] = a_frame(1, clouds={"lidar": far})
    with pytest.raises(AdvpipeError, match="give metres"):
        imported(tmp_path / "far")


def test_an_existing_output_is_replaced_only_if_asked(drive, tmp_path):
    first = digest(imported(tmp_path / "d").bag)
    with pytest.raises(OutputExistsError):
        imported(tmp_path / "d")
    drive.count = 2
    assert digest(imported(tmp_path / "d", overwrite=True).bag) != first


def test_unknown_forms_and_options_of_other_forms_are_refused(drive, tmp_path):
    with pytest.raises(UsageError, match="did you mean 'tiny'"):
        import_drive(ImportRequest("tini", tmp_path, ImportOptions()), tmp_path / "d")
    with pytest.raises(UsageError, match="means nothing to the form tiny"):
        imported(tmp_path / "d", columns="x,y,z")


def test_options_without_a_meaning_are_refused():
    with pytest.raises(UsageError, match="not an SPDX identifier"):
        ImportOptions(licence="free for all!")
    with pytest.raises(UsageError, match="leaves no intensity"):
        ImportOptions(scale_intensity=0.0)
    with pytest.raises(UsageError, match="class of the source is missing"):
        ImportOptions(classes={"": "car"})


def test_an_error_names_the_flag_that_the_command_line_has():
    with use_flags():
        for option, flag in (("interval_s", "--interval"), ("classes", "--class")):
            given = ImportOptions(**{option: {"Van": "car"} if option == "classes" else 1.0})
            with pytest.raises(UsageError, match=f"^{flag} means nothing"):
                given.refuse_others("tiny", ())


def test_a_licence_that_nobody_stated_is_said_to_be_the_forms(drive, tmp_path):
    assert any("give licence" in note for note in imported(tmp_path / "d").notes)
    assert not any("give licence" in note for note in imported(tmp_path / "own", licence="MIT").notes)
