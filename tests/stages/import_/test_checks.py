"""What every import is checked for: warnings of what may be wrong, of nothing that is right."""

from __future__ import annotations

import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import advpipe.sample
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.import_ import run
from advpipe.stages.import_.checks import DriveChecks
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.point_files import read_point_file

sys.path.insert(0, str(Path(__file__).parent))

from point_bytes import pcd, some_points


def real_frames() -> list[VehicleFrame]:
    """The shipped sample's clouds and boxes."""
    sample = Path(next(iter(advpipe.sample.__path__))) / "clean"
    return [VehicleFrame({"lidar": frame.cloud}, frame.boxes) for frame in read_frames(sample)]


def warnings_of(*vehicles: VehicleFrame, repeated: int = 5) -> list[str]:
    checks = DriveChecks(are_related=True)
    for stamp, vehicle in enumerate(vehicles * repeated):
        checks.check(DriveFrame(str(stamp), stamp, {"ego": vehicle}))
    checks.finish()
    return checks.warnings


def test_a_drive_that_is_right_warns_of_nothing() -> None:
    assert warnings_of(*real_frames()) == []


@pytest.mark.parametrize("axes", ["zyx", "xzy", "yzx", "zxy"])
def test_axes_of_a_camera_are_noticed(axes: str) -> None:
    cloud = real_frames()[0].clouds["lidar"]
    turned = cloud.copy()
    for ours, theirs in zip("xyz", axes, strict=True):
        turned[ours] = cloud[theirs]
    (warning,) = warnings_of(VehicleFrame({"lidar": turned}))
    assert f"flattest along {'xyz'[axes.index('z')]}" in warning


@pytest.mark.parametrize("change", ["mirrored", "raised", "other frame"])
def test_boxes_that_hold_no_points_are_noticed(change: str) -> None:
    changed = []
    for vehicle in real_frames():
        cloud, boxes = vehicle.clouds["lidar"].copy(), vehicle.boxes
        assert boxes is not None
        geometry = boxes.geometry.copy()
        if change == "mirrored":
            cloud["y"] *= -1
        elif change == "raised":
            geometry[:, 2] += 5
        else:
            geometry[:, :2] = geometry[:, 1::-1] + 4
        changed.append(VehicleFrame({"lidar": cloud}, replace(boxes, geometry=geometry)))
    (warning,) = warnings_of(*changed)
    assert "boxes and clouds may differ in frame, unit, axes" in warning


@pytest.mark.parametrize(("boxes", "is_told"), [(2, False), (3, True), (19, True)])
def test_a_short_drive_is_judged_by_the_boxes_that_it_has(boxes: int, is_told: bool) -> None:
    (vehicle, *_) = real_frames()
    assert vehicle.boxes is not None
    place = np.array([[10.0, 0.0, 40.0, 4.0, 2.0, 1.5, 0.0]])  # in the air
    aside = Boxes(
        np.repeat(place, boxes, axis=0),
        np.zeros(boxes, np.int64),
        tuple(map(str, range(boxes))),
        np.full((boxes, 3), np.nan),
    )
    warnings = warnings_of(replace(vehicle, boxes=aside), repeated=1)
    told = [f"Of {boxes} labelled boxes within 20 m, 0 hold points" in each for each in warnings]
    assert told == ([True] if is_told else [])


def test_millimetres_are_no_size_of_a_road_user() -> None:
    (vehicle, *_) = real_frames()
    assert vehicle.boxes is not None
    geometry = vehicle.boxes.geometry * [1, 1, 1, 1000, 1000, 1000, 1]
    with pytest.raises(AdvpipeError, match=r"0: a box has the size \d+ m, .* up to 30 m long; give metres"):
        warnings_of(replace(vehicle, boxes=replace(vehicle.boxes, geometry=geometry)))


def test_a_scale_of_255_is_noticed_once(tmp_path: Path) -> None:
    points = some_points()
    points["intensity"] *= 255
    (tmp_path / "a.pcd").write_bytes(pcd(points))
    bright = VehicleFrame({"lidar": read_point_file(tmp_path / "a.pcd", None)})
    (warning,) = warnings_of(bright)
    assert "--scale-intensity (0.00392157 for 0 to 255)" in warning
    scaled = VehicleFrame({"lidar": read_point_file(tmp_path / "a.pcd", None, 1 / 255)})
    assert warnings_of(scaled) == []


def request(folder: Path, **options: object) -> ImportRequest:
    folder.mkdir(exist_ok=True)
    for k in range(3):
        (folder / f"{k}.pcd").write_bytes(pcd(some_points(k)))
    return ImportRequest("files", folder, ImportOptions(**options))


def test_what_else_is_in_a_data_set_stays_when_its_drive_is_imported_again(tmp_path: Path) -> None:
    run.import_drive(request(tmp_path / "f"), tmp_path / "d")
    (tmp_path / "d" / "adv").mkdir()
    with pytest.raises(OutputExistsError):
        run.import_drive(request(tmp_path / "f"), tmp_path / "d")
    run.import_drive(request(tmp_path / "f", frames="1:"), tmp_path / "d", overwrite=True)
    assert len(list(read_frames(tmp_path / "d" / "clean"))) == 2
    assert (tmp_path / "d" / "adv").is_dir()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "f"]


def test_a_foreign_folder_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "d" / "clean").mkdir(parents=True)
    (tmp_path / "d" / "clean" / "thesis.txt").touch()
    with pytest.raises(UsageError, match="it is not replaced"):
        run.import_drive(request(tmp_path / "f"), tmp_path / "d", overwrite=True)
    assert (tmp_path / "d" / "clean" / "thesis.txt").exists()


def test_two_imports_of_the_same_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second is refused while the first is at work, which goes on."""
    begun, may_end = threading.Event(), threading.Event()
    check = DriveChecks.check

    def slow(checks: DriveChecks, frame: DriveFrame) -> None:
        begun.set()
        assert may_end.wait(60)
        check(checks, frame)

    monkeypatch.setattr(DriveChecks, "check", slow)
    wanted = request(tmp_path / "f")
    first = threading.Thread(target=run.import_drive, args=(wanted, tmp_path / "d"))
    first.start()
    assert begun.wait(60)
    try:
        with pytest.raises(AdvpipeError, match="locked by another run"):
            run.import_drive(wanted, tmp_path / "d")
    finally:
        may_end.set()
        first.join()
    assert len(list(read_frames(tmp_path / "d" / "clean"))) == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "f"]


def test_a_source_that_ends_early_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from advpipe.stages.import_.files import PointFolder

    whole = PointFolder.frames
    monkeypatch.setattr(PointFolder, "frames", lambda self, first=0: list(whole(self, first))[:2])
    with pytest.raises(AdvpipeError, match="ends after 2 of 3 frames"):
        run.import_drive(request(tmp_path / "f"), tmp_path / "d")
    assert [path.name for path in tmp_path.iterdir()] == ["f"]


@pytest.mark.parametrize("name", ["lidar_height_m", "scale_intensity", "interval_s"])
def test_options_have_to_be_finite(name: str) -> None:
    for value in (float("nan"), float("inf")):
        with pytest.raises(UsageError):
            ImportOptions(**{name: value})
