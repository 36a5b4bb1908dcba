"""What a detector whose findings are known sees in clean and attacked pictures."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from picture_drive import STEP_NS, ColourDetector, painted, record_pictures, rectangles_at

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.results.camera import CameraRecord
from advpipe.stages.evaluate.camera.section import camera_sections, check_image_detector

Image = np.ndarray
DETECTOR = "colours:ColourDetector"


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("colours")
    module.ColourDetector = ColourDetector  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "colours", module)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_pictures(tmp_path_factory.mktemp("drive") / "clean")


def rows(clean: Path, *attacked: Path) -> dict[tuple[str, str, str], CameraRecord]:
    """By bag, condition and class, at moderate difficulty."""
    (section,) = camera_sections(clean, attacked, DETECTOR, "cpu")
    return {
        (each.bag, each.condition, each.class_name): each
        for each in section.records
        if isinstance(each, CameraRecord) and each.difficulty == "moderate"
    }


def test_a_detector_that_sees_everything_has_all_precision(clean: Path) -> None:
    found = rows(clean)
    assert set(found) == {("clean", "clean", "car"), ("clean", "clean", "pedestrian")}
    for each in found.values():
        assert (each.pictures, each.objects, each.ap, each.ap_half, each.found, each.lost) == (
            6,
            6,
            1,
            1,
            6,
            0,
        )


def attacked(folder: Path, shown: Callable[[int], Image | None], late_ns: int = 0) -> Path:
    return record_pictures(folder / "adv", shown=shown, late_ns=late_ns)


def without_car(number: int) -> Image:
    return painted(rectangles_at(number)[1:] if number >= 4 else rectangles_at(number))


def test_only_attacked_moments_count_beside_an_attack(clean: Path, tmp_path: Path) -> None:
    found = rows(clean, attacked(tmp_path, without_car))
    before, after = found["adv", "clean", "car"], found["adv", "adv", "car"]
    assert (before.pictures, before.objects, before.ap, before.found) == (2, 2, 1, 2)
    assert (after.pictures, after.objects, after.ap, after.found, after.lost) == (2, 2, 0, 0, 2)
    assert found["adv", "adv", "pedestrian"].lost == 0


@pytest.mark.parametrize("kind", ["dropped", "frozen", "delayed"])
def test_a_receiver_sees_the_newest_picture_that_has_arrived(clean: Path, tmp_path: Path, kind: str) -> None:
    """The car moves by 2 of its 61 columns a picture; only the first one shows anything from the second on,
    or each comes one step late."""

    def shown(number: int) -> Image | None:
        if kind == "dropped" and number:
            return None
        return painted(rectangles_at(0 if kind == "frozen" else number))

    found = rows(clean, attacked(tmp_path, shown, STEP_NS if kind == "delayed" else 0))
    car = found["adv", "adv", "car"]
    assert car.pictures == (6 if kind == "delayed" else 5)
    # 10 columns late, 50 of 70 are shared: an IoU of 0.71, which still matches; nothing at all does not.
    assert car.lost == (1 if kind == "delayed" else 0)


def test_a_bag_with_the_same_pictures_adds_nothing(clean: Path, tmp_path: Path) -> None:
    same = record_pictures(tmp_path / "same")
    assert {bag for bag, _, _ in rows(clean, same)} == {"clean"}


def test_tables_and_pictures_show_both(clean: Path, tmp_path: Path) -> None:
    (section,) = camera_sections(clean, [attacked(tmp_path, without_car)], DETECTOR, "cpu")
    assert [table.title for table in section.tables] == [
        "clean, ego: front, 6 pictures",
        "adv, ego: front, 2 attacked pictures",
    ]
    assert ("car", "moderate", "2", "100.0 → 0.0", "100.0 → 0.0", "2 → 0", "2") in section.tables[1].lines
    assert [picture.file_name for picture in section.pictures] == ["adv-ego-front-camera.png"]
    assert section.pictures[0].png.startswith(b"\x89PNG")


def test_none_scores_no_camera_and_nobody_is_refused(clean: Path) -> None:
    assert camera_sections(clean, [], "none", "cpu") == ()
    for refused in (
        lambda: camera_sections(clean, [], "nobody", "cpu"),
        lambda: check_image_detector(clean, "nobody"),
    ):
        with pytest.raises(UsageError, match="unknown image detector"):
            refused()
    check_image_detector(clean, "none")
