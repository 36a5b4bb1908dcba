"""Which of KITTI's forms a folder has, and an import that is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.import_.kitti.form import KittiForm
from advpipe.stages.import_.options import ImportOptions
from tests.stages.import_.kitti.kitti_folders import (
    write_cloud,
    write_object_frames,
    write_odometry,
    write_raw_drive,
)


@pytest.mark.parametrize("place", [".", "training"])
def test_object_frames_are_told_by_their_folders(tmp_path, place):
    source = KittiForm().open(write_object_frames(tmp_path) / place, ImportOptions())
    assert (source.name, source.frame_count, source.are_related) == ("kitti-training", 2, False)


def test_a_raw_drive_is_told_at_every_level(tmp_path):
    drive = write_raw_drive(tmp_path / "2011_09_26")
    for place in (tmp_path, drive.parent, drive):
        source = KittiForm().open(place, ImportOptions())
        assert (source.name, source.frame_count, source.are_related) == (drive.name, 3, True)


def test_a_sequence_is_told_at_every_level(tmp_path):
    sequence = write_odometry(tmp_path)
    for place in (tmp_path, sequence):
        source = KittiForm().open(place, ImportOptions())
        assert (source.name, source.frame_count, source.are_related) == ("sequence 04", 3, True)


def test_one_of_several_drives_is_named(tmp_path):
    for number in ("0005", "0011"):
        write_raw_drive(tmp_path / "2011_09_26", number, frames=1)
    names = "2011_09_26_drive_0005_sync, 2011_09_26_drive_0011_sync"
    with pytest.raises(UsageError, match=f"has 2 drives; choose one .*: {names}"):
        KittiForm().open(tmp_path, ImportOptions())
    with pytest.raises(UsageError, match=f"has no drive '0012'; .*{names}"):
        KittiForm().open(tmp_path, ImportOptions(drive="0012"))
    for drive in ("0011", "2011_09_26_drive_0011_sync"):
        assert KittiForm().open(tmp_path, ImportOptions(drive=drive)).name == "2011_09_26_drive_0011_sync"


@pytest.mark.parametrize(
    ("write", "options", "problem"),
    [
        (write_object_frames, {"drive": "1"}, "--drive means nothing to KITTI's object"),
        (write_object_frames, {"interval_s": 0.0}, "--interval 0: frames follow one another"),
        (write_odometry, {"split": "val"}, "--split means nothing to KITTI's odometry"),
        (write_odometry, {"interval_s": 0.1}, "--interval means nothing to KITTI's odometry"),
        (write_odometry, {"classes": {"Van": "car"}}, "--class means nothing to KITTI's odometry"),
        (
            lambda root: write_raw_drive(root / "2011_09_26"),
            {"split": "val"},
            "--split means nothing to KITTI's raw",
        ),
    ],
)
def test_options_of_another_form_are_refused(tmp_path, write, options, problem):
    write(tmp_path)
    with pytest.raises(UsageError, match=problem):
        KittiForm().open(tmp_path, ImportOptions(**options))


def test_other_folders_are_refused(tmp_path):
    with pytest.raises(UsageError, match="does not exist; give KITTI's folder"):
        KittiForm().open(tmp_path / "none", ImportOptions())
    with pytest.raises(UsageError, match="is no folder of KITTI"):
        KittiForm().open(tmp_path, ImportOptions())
    (tmp_path / "labels" / "label_2").mkdir(parents=True)
    with pytest.raises(UsageError, match=r"velodyne holds no \.bin files; unpack KITTI's velodyne archive"):
        KittiForm().open(tmp_path / "labels", ImportOptions())
    write_odometry(write_object_frames(tmp_path))
    with pytest.raises(UsageError, match="mixes KITTI's forms object and odometry"):
        KittiForm().open(tmp_path, ImportOptions())


@pytest.mark.nightly
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_killed_import_resumes_to_the_same_bytes(tmp_path):
    root = write_object_frames(tmp_path / "kitti", tuple(f"{index:06d}" for index in range(25)))
    command = [sys.executable, "-m", "advpipe", "import", "kitti", str(root), "--out"]
    subprocess.run([*command, str(tmp_path / "whole")], check=True, capture_output=True)
    stuck = root / "training" / "velodyne" / "000022.bin"
    stuck.unlink()
    os.mkfifo(stuck)  # reading it waits for ever
    run = subprocess.Popen(
        [*command, str(tmp_path / "resumed")], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob(".resumed.*.job/00000000")) and time.monotonic() < deadline:
        time.sleep(0.05)
    run.send_signal(signal.SIGKILL)
    run.communicate()
    assert not (tmp_path / "resumed").exists()
    stuck.unlink()
    write_cloud(stuck, 22)
    (root / "training" / "velodyne" / "000003.bin").unlink()  # of a part that is done: not read again
    write_cloud(root / "training" / "velodyne" / "000003.bin", 99)
    subprocess.run([*command, str(tmp_path / "resumed")], check=True, capture_output=True)
    assert bag_bytes(tmp_path / "resumed") == bag_bytes(tmp_path / "whole")
    assert not list(tmp_path.glob(".resumed*"))


def bag_bytes(dataset: Path) -> bytes:
    return (dataset / "clean" / "clean_0.mcap").read_bytes()
