"""A checkpoint tells the maps that it was trained on, those of the one that it started from included."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from advpipe.pipeline.detector.checkpoint import save_checkpoint
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.family import SHIPPED
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.detector.training_maps import is_training_map
from advpipe.stages.train import run
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.maps import training_maps

A, B, C = ("a" * 64, "b" * 64, "c" * 64)


@pytest.fixture
def config(record, tiny, tmp_path):
    bags = tuple(record(tmp_path / name, 1, 1, map_sha256=digest) for name, digest in (("b", B), ("a", A)))
    return TrainConfig(bags=bags, out=tmp_path / "run", steps=1, preset="tiny", workers=1)


def test_a_checkpoint_records_its_training_maps(config, record, tmp_path):
    first = run.train(config)
    trained = load_detector(str(first.checkpoint))
    assert trained.training_maps_sha256 == [A, B]
    assert (is_training_map(trained, A), is_training_map(trained, C)) == (True, False)

    onward = replace(
        config,
        bags=(record(tmp_path / "c", 1, 2, map_sha256=C),),
        out=tmp_path / "on",
        start=first.checkpoint,
    )
    assert load_detector(str(run.train(onward).checkpoint)).training_maps_sha256 == [A, B, C]


def test_a_bag_without_a_map_adds_null(config, record, tmp_path):
    bare = record(tmp_path / "bare", 1, 3)
    assert json.loads(training_maps([*config.bags, bare], None)) == [A, B, None]


def test_maps_of_the_start_checkpoint_are_included_or_null(config, tmp_path):
    known = json.loads(training_maps(config.bags, SHIPPED["small"]))
    assert {A, B} < set(known)
    assert len(known) == 45
    assert None not in known
    silent = tmp_path / "silent.safetensors"
    save_checkpoint(SecondNet(SMALL), silent, {})
    assert json.loads(training_maps(config.bags, silent)) == [A, B, None]
