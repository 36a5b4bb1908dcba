"""Printed patches in the bags: where they are, what of an image they change, whom they hide."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from camera_bags import FRONT, REAR, images, labels, same

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.compressed_image import image_from_cdr, pixels_of
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.camera.drive import RecordedDrive
from advpipe.stages.attack.camera.patch_place import PatchSize, vehicles_ahead
from advpipe.stages.attack.camera.patch_view import patch_view
from advpipe.stages.attack.camera.scene_light import SceneLight
from advpipe.stages.attack.run import AttackRequest, attack


def test_without_a_target_the_patch_is_where_most_of_it_is_seen(camera_drive: Path) -> None:
    """Over all images of the schedule, from 0.4 to 0.9 s: by the scenes themselves."""
    reader = BagReader(camera_drive / "clean")
    (camera,) = [each for each in cameras_of(reader) if each.image_topic == FRONT]
    drive = RecordedDrive(reader, camera, SceneLight(reader), {}, lambda time_ns: True)
    size, seen_px = PatchSize(1.2, 0.7), Counter[str]()
    for number, (_, scene) in enumerate(drive.scheduled()):
        for each in vehicles_ahead(scene(), size, 0.85) if 4 <= number < 9 else ():
            seen_px[each.name] += len(patch_view(scene(), each, (1, 1)).pixels)
    (largest, most), *others = seen_px.most_common()
    assert others
    assert most > 5 * 50
    assert {row["target"] for row in labels(camera_drive / "patch")} == {largest}


def test_a_patch_changes_its_rectangle_alone(camera_drive: Path) -> None:
    rows = {row["image"]: row for row in labels(camera_drive / "patch")}
    assert set(rows) == set(range(4, 9))
    clean, found = (images(camera_drive / name) for name in ("clean", "patch"))
    for number, (before, after) in enumerate(zip(clean, found, strict=True)):
        if number not in rows:
            assert same(before, after)
            continue
        row = rows[number]
        plain, painted = (pixels_of(image_from_cdr(raw.cdr).file).astype(int) for raw in (before, after))
        apart = np.abs(plain - painted).max(axis=2)
        inside = apart[row["top_px"] : row["bottom_px"] + 1, row["left_px"] : row["right_px"] + 1]
        assert (inside > 25).mean() > 0.5
        apart[
            max(row["top_px"] - 16, 0) : row["bottom_px"] + 17,
            max(row["left_px"] - 16, 0) : row["right_px"] + 17,
        ] = 0
        assert np.quantile(apart, 0.999) <= 10  # a JPEG of a JPEG
        assert row["target"]
        assert 12 <= row["pixels"] <= inside.size
    print_px = pixels_of((camera_drive / "patch" / f"camera_patch_{rows[4]['target']}.png").read_bytes())
    assert print_px.shape == (14 * 16, 24 * 16, 3)  # 0.7 m by 1.2 m in squares of 0.05 m


def test_a_found_texture_hides_the_vehicle_better_than_random_ones(
    camera_drive: Path, tmp_path: Path
) -> None:
    """By a detector of one's own, in the bags."""
    import torch
    from red_detector import RedDetector

    detector = RedDetector()
    means = {}
    for pattern in ("adversarial", "random", "random-best"):
        own = {"camera": "front", "pattern": pattern, "image_detector": "red_detector:RedDetector"}
        spec = AttackSpec(type="camera-patch", parameters={**own, "steps": 40, "learning_rate": 0.2})
        attack(camera_drive / "clean", tmp_path / pattern, AttackRequest((spec,)))
        found, scores = images(tmp_path / pattern), []
        for row in labels(tmp_path / pattern):
            rgb = pixels_of(image_from_cdr(found[row["image"]].cdr).file)
            edges = torch.tensor([[row[f"{edge}_px"] for edge in ("left", "top", "right", "bottom")]]).float()
            image = torch.from_numpy(rgb.copy()).permute(2, 0, 1).float() / 255
            scores.append(float(detector.objectness(image, edges, torch.tensor([0]))[0]))
        means[pattern] = np.mean(scores)
    assert means["adversarial"] < means["random-best"] - 0.1
    assert means["random-best"] <= means["random"] + 0.02


def test_a_patch_needs_depth(camera_drive: Path, tmp_path: Path) -> None:
    reader = BagReader(camera_drive / "clean")
    kept = [name for name in reader.topics if name != "/ego/rear/depth/compressed"]
    with BagWriter(tmp_path / "clean", provenance=dict(reader.provenance)) as writer:
        for raw in reader.raw_messages(kept):
            writer.copy(raw)
    spec = AttackSpec(type="camera-patch", parameters={"pattern": "random"})
    with pytest.raises(UsageError, match=r"has no /ego/rear/depth/compressed; record the camera with"):
        attack(tmp_path / "clean", tmp_path / "out", AttackRequest((spec,)))


def test_all_cameras_see_one_print(camera_drive: Path, tmp_path: Path) -> None:
    """Of the vehicle ahead, which the rear camera does not show."""
    spec = AttackSpec(type="camera-patch", parameters={"pattern": "random"})
    attack(camera_drive / "clean", tmp_path / "both", AttackRequest((spec,)))
    assert len(list((tmp_path / "both").glob("camera_patch_*.png"))) == 1
    assert {row["topic"] for row in labels(tmp_path / "both")} == {FRONT}
    assert all(map(same, images(tmp_path / "both", REAR), images(camera_drive / "clean", REAR)))
