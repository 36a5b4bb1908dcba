"""PointPillars and CenterPoint are trained like SECOND: they learn, and go on after a stop."""

from __future__ import annotations

import csv
import os
import signal
from dataclasses import replace

import pytest

from advpipe.pipeline.detector.centerpoint import presets as centerpoint
from advpipe.pipeline.detector.pointpillars import presets as pointpillars
from advpipe.pipeline.detector.protocol import BatchDetector, Range
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.train import run
from advpipe.stages.train.config import Augmentation, TrainConfig

HALF_M = {"pointpillars": 7.68, "centerpoint": 8.0}
"""Whole cells of the coarsest block."""


@pytest.fixture(params=HALF_M)
def family(request, monkeypatch):
    """The name of a family with a preset `tiny`: `small` over a sixth of the width."""
    presets, half_m = {"pointpillars": pointpillars, "centerpoint": centerpoint}[request.param], HALF_M
    half_m = HALF_M[request.param]
    tiny = replace(presets.SMALL, name="tiny", range_m=Range(-half_m, -half_m, -3.1, half_m, half_m, 2.3))
    monkeypatch.setitem(presets.PRESETS, "tiny", tiny)
    return request.param


def config(drive, out, family, **changes):
    settings = {"steps": 4, "checkpoint_every": 100, "preset": "tiny", "workers": 1, **changes}
    return TrainConfig((drive,), out, family=family, **settings)


def losses(summary):
    with summary.log.open(newline="") as file:
        return [float(row["loss"]) for row in csv.DictReader(file)]


def test_the_loss_falls(record, tmp_path, family):
    drive = record(tmp_path / "bag", frames=1, seed=1)
    learning = {"steps": 25, "batch_size": 1, "augmentation": Augmentation.none()}
    summary = run.train(config(drive, tmp_path / "run", family, **learning))
    history = losses(summary)
    assert history[-1] < history[0] / 2
    assert isinstance(load_detector(str(summary.checkpoint)), BatchDetector)


@pytest.mark.nightly
def test_a_frame_is_learned(record, tmp_path, family):
    drive = record(tmp_path / "bag", frames=1, seed=1)
    learning = {"steps": 110, "batch_size": 1, "augmentation": Augmentation.none(), "validation": drive}
    summary = run.train(config(drive, tmp_path / "run", family, **learning))
    assert losses(summary)[-1] < losses(summary)[0] / 5
    assert summary.precision["car"].loose_percent == pytest.approx(100)
    assert sum(precision.loose_percent for precision in summary.precision.values()) >= 300


def test_an_interruption_changes_no_byte(drive, tmp_path, family, monkeypatch):
    whole, step = run.train(config(drive, tmp_path / "whole", family)), run.train_step

    def interrupted_step(state, *arguments):
        if state.step == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return step(state, *arguments)

    parts = config(drive, tmp_path / "parts", family, workers=2)
    with monkeypatch.context() as patch:
        patch.setattr(run, "train_step", interrupted_step)
        with pytest.raises(KeyboardInterrupt):
            run.train(parts)
    resumed = run.train(parts)
    assert resumed.checkpoint.read_bytes() == whole.checkpoint.read_bytes()
    assert resumed.log.read_bytes() == whole.log.read_bytes()
