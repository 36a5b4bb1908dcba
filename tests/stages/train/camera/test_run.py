"""Training on pictures: the same seed gives the same bytes, interrupted or not, and it learns."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from picture_drive import record_pictures

import advpipe
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.image_detector.checkpoint import load_image_checkpoint
from advpipe.pipeline.image_detector.registry import image_detector_named
from advpipe.stages.train.camera import run
from advpipe.stages.train.camera.config import ImageAugmentation, ImageTrainConfig


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_pictures(tmp_path_factory.mktemp("drive") / "clean")


def configured(drive: Path, out: Path, **changes: Any) -> ImageTrainConfig:
    small = ImageAugmentation(size_px=(128, 96), scale=(0.9, 1.1))
    return ImageTrainConfig(
        bags=(drive,), out=out, **{"steps": 3, "batch_size": 2, "augmentation": small, **changes}
    )


def test_the_same_seed_gives_the_same_bytes_even_interrupted(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run.train_camera(configured(drive, tmp_path / "a")).checkpoint.read_bytes()
    other = run.train_camera(configured(drive, tmp_path / "c", seed=1)).checkpoint.read_bytes()
    assert whole != other
    step = run.train_step

    def stops(state: Any, *arguments: Any) -> Any:
        if state.step == 2:
            raise KeyboardInterrupt
        return step(state, *arguments)

    config = configured(drive, tmp_path / "b", checkpoint_every=1)
    monkeypatch.setattr(run, "train_step", stops)
    with pytest.raises(KeyboardInterrupt):
        run.train_camera(config)
    monkeypatch.setattr(run, "train_step", step)
    assert run.train_camera(config).checkpoint.read_bytes() == whole
    assert {path.name for path in (tmp_path / "b").iterdir()} == {
        *("detector.safetensors", "config.json", "train.csv", "validation.csv", "training.png")
    }


def test_it_learns_what_the_pictures_show(drive: Path, tmp_path: Path) -> None:
    config = configured(drive, tmp_path / "run", steps=60, learning_rate=5e-3, validation=drive)
    summary = run.train_camera(config)
    rows = list(csv.DictReader(summary.log.open()))
    losses = [float(row["loss"]) for row in rows]
    assert sum(losses[-5:]) < 0.5 * sum(losses[:5])
    assert {each.class_name for each in summary.precision if each.objects} == {"car", "pedestrian"}
    detector = load_image_checkpoint(summary.checkpoint)
    assert detector.training_maps_sha256 == ["a" * 64]
    assert detector.provenance["pictures"] == "6"
    assert image_detector_named(str(summary.checkpoint)).classes == detector.classes


def test_bad_input_is_refused_in_one_line(drive: Path, tmp_path: Path) -> None:
    from small_drive import record_small_drive

    blind = record_small_drive(tmp_path / "blind", steps=2)
    with pytest.raises(UsageError, match="holds no camera with labelled pictures; simulate a drive with"):
        advpipe.train_camera(blind, out=tmp_path / "out")
    with pytest.raises(UsageError, match="is also a training bag"):
        advpipe.train_camera(drive, out=tmp_path / "out", validate=drive)
    with pytest.raises(AdvpipeError, match="steps are 0, but must be 1 or more"):
        advpipe.train_camera(drive, out=tmp_path / "out", steps=0)
    with pytest.raises(AdvpipeError, match="learning_rate is nan"):
        advpipe.train_camera(drive, out=tmp_path / "out", learning_rate=float("nan"))
    assert not (tmp_path / "out").exists()
