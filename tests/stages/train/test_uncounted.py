"""What a drive leaves unlabelled is no background to learn: stored, augmented and left out of the loss."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.detector.common.anchors import AnchorGrid, Targets
from advpipe.pipeline.detector.common.loss import focal_losses
from advpipe.pipeline.detector.expected_input import ExpectedInput, with_trained_height
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.train.augment import augment
from advpipe.stages.train.config import Augmentation
from advpipe.stages.train.frames import FrameStore, TrainingFrame, cropped
from advpipe.stages.train.mounts import expected_height, mounts_of_frames
from tests.stages.import_.importing import import_form
from tests.stages.import_.kitti.kitti_folders import write_object_frames

VAN = np.array([[10.0, -4.4, -0.9, 5.0, 2.0, 2.0, 0.3]])
AHEAD = ConvexRegion("ahead", np.array([[1.0, -1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]]))
FAR_LEFT = ConvexRegion("far left", np.array([[0.0, 1.0, 0.0, -15.0]]), 40.0)
PARTIAL = Uncounted(IgnoredBoxes(VAN, ("Van",), ("v",)), LabelCoverage((AHEAD,), (FAR_LEFT,)))


def places(count: int = 5000) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-40, 40, (count, 2)), rng.uniform(-2, 0, count)])


def test_a_store_keeps_what_does_not_count(drive: Path, tmp_path: Path) -> None:
    parts = (Uncounted(), PARTIAL) * 3
    frames = [replace(frame, uncounted=part) for frame, part in zip(read_frames(drive), parts, strict=True)]
    store = FrameStore.build((cropped(frame, 100.0) for frame in frames), tmp_path / "frames", "key")
    for k in range(len(frames)):
        stored = store.frame(k)
        assert len(stored.ignored) == k % 2
        expected = frames[k].uncounted.coverage
        assert len(stored.coverage.labelled) == len(expected.labelled)
        assert np.array_equal(stored.coverage.counts(places()), expected.counts(places()))


@pytest.mark.parametrize("seed", range(4))
def test_regions_turn_with_the_points(drive: Path, tmp_path: Path, seed: int) -> None:
    """A point that counted before counts afterwards, wherever it has moved."""
    frame = replace(next(read_frames(drive)), uncounted=PARTIAL)
    stored = FrameStore.build((cropped(frame, 100.0) for frame in [frame]), tmp_path / "frames", "key").frame(
        0
    )

    def augmented(given: TrainingFrame) -> TrainingFrame:
        changes = Augmentation(drop=0.0, jitter_m=0.0, paste=(0, 0, 0, 0))
        return augment(given, changes, (0.2, 0.2, 0.2), np.random.default_rng(seed))

    tracked = np.column_stack([places(), np.zeros(5000)]).astype(np.float32)
    counted = stored.coverage.counts(tracked[:, :3].astype(np.float64))
    after = augmented(replace(stored, points=tracked))
    differs = after.coverage.counts(after.points[:, :3].astype(np.float64)) != counted
    assert differs.mean() < 0.01  # float32, and the range limit, which is not scaled
    assert 0.1 < counted.mean() < 0.9
    before = augmented(replace(stored, boxes=stored.ignored.copy()))
    assert np.allclose(before.ignored, before.boxes)
    assert not np.allclose(before.ignored, VAN)


def test_no_anchor_is_background_where_nobody_looked() -> None:
    grid = AnchorGrid(SMALL, 128, 128)
    ahead, behind = ([x, 0.4, -1.0, 4.5, 1.85, 1.55, 0.0] for x in (20.4, -20.4))
    boxes, labels = torch.tensor([ahead, behind]), torch.tensor([0, 0])
    everywhere, partly = grid.assign(boxes, labels), grid.assign(boxes, labels, None, PARTIAL)
    assert torch.equal(everywhere.positive, partly.positive)  # what is labelled counts, behind too
    assert not set(partly.ignored.tolist()) & set(partly.positive.tolist())
    anchors = grid.boxes(torch.arange(128 * 128 * grid.per_cell)).double().numpy()
    unseen = PARTIAL.ignores_centres(anchors)
    unseen[partly.positive] = False
    assert set(np.flatnonzero(unseen)) <= set(partly.ignored.tolist())
    on_van = np.hypot(*(anchors[:, :2] - VAN[0, :2]).T) < 0.3
    upright = np.isclose(anchors[:, 6], 0.0) & (np.abs(anchors[:, 3] - 5) < 1)
    assert (on_van & upright).any()
    assert set(np.flatnonzero(on_van & upright)) <= set(partly.ignored.tolist())

    def focal_loss(scores: torch.Tensor, target: Targets) -> torch.Tensor:
        cloud_of = torch.zeros(len(target.positive), dtype=torch.int64)
        background, hits = focal_losses(scores[None], [target], cloud_of)
        return background[0] + hits.sum()

    scores = torch.full((len(anchors), 4), -4.0)
    loss = focal_loss(scores, partly)
    scores[torch.from_numpy(unseen)] = 4.0
    assert focal_loss(scores, partly) == loss
    assert focal_loss(scores, everywhere) > 10 * focal_loss(torch.full_like(scores, -4.0), everywhere)


def test_clouds_of_drives_are_seen_from_the_height_that_the_preset_expects(tmp_path: Path) -> None:
    kitti = write_object_frames(tmp_path / "kitti")
    heights_m = (1.5, 2.0)
    bags = [import_form("kitti", kitti, tmp_path / str(h), lidar_height_m=h).bag for h in heights_m]
    mounts = list(mounts_of_frames(bags, ExpectedInput(1.8)))
    frames = [frame for bag in bags for frame in read_frames(bag)]
    assert [round(mount.raised_m, 6) for mount in mounts] == [-0.3] * (len(frames) // 2) + [0.2] * (
        len(frames) // 2
    )
    store = FrameStore.build((cropped(frame, 100.0) for frame in frames), tmp_path / "frames", "key", mounts)
    for i in (0, len(frames) - 1):
        recorded, raised_m = frames[i], mounts[i].raised_m
        stored = store.frame(i)
        assert stored.boxes[:, 2] == pytest.approx(recorded.boxes.geometry[:, 2] + raised_m, abs=1e-5)
        assert stored.points[:, 2].mean() == pytest.approx(recorded.cloud["z"].mean() + raised_m, abs=1e-3)
    last = len(store.labels) - 1
    points, box = store.object(last)
    assert box[2] == pytest.approx(frames[-1].boxes.geometry[-1, 2] + mounts[-1].raised_m, abs=1e-5)
    assert all(abs(points[:, 2] - box[2]) <= box[5] / 2 + 1e-4)


def test_a_checkpoint_declares_the_height_of_its_preset() -> None:
    about = expected_height(ExpectedInput(1.83))
    assert about == {"lidar_height_m": "1.83"}
    assert with_trained_height(ExpectedInput(1.8, 255.0), about) == ExpectedInput(1.83, 255.0)
    assert with_trained_height(None, about) == ExpectedInput(1.83)
    for unusable in ({}, {"lidar_height_m": "high"}, {"lidar_height_m": "nan"}, {"lidar_height_m": "170"}):
        assert with_trained_height(ExpectedInput(1.8), unusable) == ExpectedInput(1.8)
    assert expected_height(None) == {}
