"""Folders of .pcd files: every point, box, pose and time comes back by `import files`, attacked ones too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import advpipe.sample
from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import OutputExistsError
from advpipe.pipeline.messages.build import se3_from_transform
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.export.form import ExportOptions
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive

FRAMES = FrameSlice(0, 4, 2)


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped sample with half of the points of its objects detached in two frames."""
    folder = tmp_path_factory.mktemp("set") / "town"
    folder.mkdir()
    (folder / "clean").symlink_to(Path(next(iter(advpipe.sample.__path__))) / "clean")
    spec = {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.5}, "frames": "0:3"}
    attack(folder / "clean", folder / "adv", AttackRequest((attack_spec(spec),)), workers=1)
    return folder


def poses_of(bag: Path) -> list[np.ndarray]:
    reader = BagReader(bag)
    return [se3_from_transform(message.transforms[0].transform) for _, message in reader.messages("/tf")]


@pytest.mark.oracle
def test_clean_and_attacked_come_back(attacked: Path, tmp_path: Path) -> None:
    from advpipe.pipeline.core.open3d_library import o3d

    summary = export_bags(attacked, "pcd", tmp_path / "out", ExportOptions(frames=FRAMES))
    assert (summary.bags, summary.notes) == (2, ())
    for name in ("clean", "adv"):
        folder = tmp_path / "out" / name
        again = import_drive(ImportRequest("files", folder, ImportOptions()), tmp_path / f"d-{name}")
        frames = list(read_frames(again.bag))
        stamps = {frame.stamp_ns for frame in frames}
        expected = [frame for frame in read_frames(attacked / name) if frame.stamp_ns in stamps]
        assert len(frames) == len(expected) > 0
        for ours, theirs in zip(frames, expected, strict=True):
            assert ours.stamp_ns == theirs.stamp_ns
            assert ours.cloud.tobytes() == theirs.cloud.tobytes()
            assert ours.boxes.ids == theirs.boxes.ids
            assert np.array_equal(ours.boxes.labels, theirs.boxes.labels)
            assert np.array_equal(ours.boxes.geometry[:, :6], theirs.boxes.geometry[:, :6])
            turned = ours.boxes.geometry[:, 6] - theirs.boxes.geometry[:, 6]
            assert np.abs(np.sin(turned)).max(initial=0) < 1e-14  # it passes through a quaternion
        points = o3d.t.io.read_point_cloud(str(folder / "points" / "000000.pcd"))
        assert np.array_equal(points.point.positions.numpy()[:, 0], expected[0].cloud["x"])
    assert names(tmp_path / "out" / "clean") == ["000000", "000002"]
    assert names(tmp_path / "out" / "adv") == ["000000", "000002"]
    detached = [len(frame.cloud) for frame in read_frames(tmp_path / "d-adv" / "clean")]
    assert detached[0] < len(next(read_frames(attacked / "clean")).cloud)


def names(folder: Path) -> list[str]:
    return sorted(file.stem for file in (folder / "points").iterdir())


def test_poses_are_those_of_the_drive(attacked: Path, tmp_path: Path) -> None:
    export_bags(attacked / "clean", "pcd", tmp_path / "out", ExportOptions(frames=FrameSlice(0, 3)))
    folder = tmp_path / "out" / "clean"
    again = import_drive(ImportRequest("files", folder, ImportOptions()), tmp_path / "d")
    reader = BagReader(attacked / "clean")
    odometry = [message for _, message in reader.messages("/ego/ground_truth/odometry")]
    for pose, message in zip(poses_of(again.bag), odometry[:3], strict=True):
        at = message.pose.pose.position
        assert np.hypot(pose[0, 3] - at.x, pose[1, 3] - at.y) < 3  # the LiDAR is on the vehicle


def test_an_export_is_replaced_only_if_asked(attacked: Path, tmp_path: Path) -> None:
    options = ExportOptions(frames=FrameSlice(0, 1))
    export_bags(attacked / "clean", "pcd", tmp_path / "out", options)
    with pytest.raises(OutputExistsError):
        export_bags(attacked / "clean", "pcd", tmp_path / "out", options)
    export_bags(attacked / "clean", "pcd", tmp_path / "out", options, overwrite=True)
