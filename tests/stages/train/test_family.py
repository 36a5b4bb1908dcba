"""A family of detectors beside SECOND: trained, saved, loaded and evaluated by its name alone."""

from __future__ import annotations

import pytest
import torch
from pillars import PillarFamily

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.checkpoint import load_checkpoint
from advpipe.pipeline.detector.families import FAMILIES, family_named
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.evaluate.run import Options, evaluate
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.run import train


@pytest.fixture
def pillars(monkeypatch):
    monkeypatch.setitem(FAMILIES, "pillars", PillarFamily())


def test_every_preset_names_its_family_and_shipped_names_are_unique():
    for name, family in FAMILIES.items():
        assert {preset.family for preset in family.presets.values()} == {name}
        assert all(key == preset.name for key, preset in family.presets.items())
    shipped = [name for family in FAMILIES.values() for name in family.shipped]
    assert len(shipped) == len(set(shipped))


def test_a_second_family_is_trained_saved_loaded_and_evaluated(drive, record, tmp_path, pillars):
    config = TrainConfig(
        (drive,), tmp_path / "run", family="pillars", preset="narrow", steps=12, workers=2, validation=drive
    )
    summary = train(config)
    header, *rows = summary.log.read_text().splitlines()
    assert header == ("step,learning_rate,loss,score_loss,box_loss,direction_loss,quality_loss,gradient_norm")
    assert len(rows) == 12
    score_loss = [float(row.split(",")[3]) for row in rows]  # that of boxes depends on the height drawn
    assert score_loss[-1] < score_loss[0]
    assert load_checkpoint(summary.checkpoint).net.preset.family == "pillars"

    detector = load_detector(str(summary.checkpoint))
    assert isinstance(detector, ObjectDetector)
    assert detector.classes == ("car", "truck", "cyclist", "pedestrian")
    points = torch.rand(200, 4).requires_grad_()
    boxes, labels = torch.tensor([[0.5, 0.5, -1.0, 4.5, 1.85, 1.55, 0.0]]), torch.tensor([0])
    detector.loss(points, boxes, labels).backward()
    assert points.grad is not None
    assert points.grad.abs().sum() > 0

    report = evaluate(
        drive, [], tmp_path / "report", Options(detectors=(str(summary.checkpoint),)), workers=1
    )
    assert report.rows[0]["frames"] == 6


def test_a_run_does_not_start_from_another_family(drive, tmp_path, pillars, tiny):
    one = train(
        TrainConfig((drive,), tmp_path / "one", family="pillars", preset="narrow", steps=1, workers=1)
    )
    config = TrainConfig((drive,), tmp_path / "two", preset=tiny, start=one.checkpoint, steps=1, workers=1)
    with pytest.raises(UsageError, match=r"'narrow' of family 'pillars', .* layers of preset 'tiny'"):
        train(config)


def test_unknown_families_presets_and_weights_are_refused(tmp_path, pillars):
    with pytest.raises(
        UsageError, match="unknown detector family 'third'; known: second, pointpillars, centerpoint, pillars"
    ):
        TrainConfig((tmp_path,), tmp_path / "run", family="third")
    with pytest.raises(UsageError, match="unknown detector preset 'small'; known: narrow"):
        TrainConfig((tmp_path,), tmp_path / "run", family="pillars")
    with pytest.raises(UsageError, match="supports no external weights"):
        family_named("pillars").import_weights(tmp_path / "theirs.pth")
