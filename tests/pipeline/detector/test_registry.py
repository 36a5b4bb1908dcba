from __future__ import annotations

import sys
import types

import pytest
import torch

from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.checkpoint import save_checkpoint
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.errors import AdvpipeError


def test_the_shipped_one():
    detector = load_detector("small")
    assert detector.preset == SMALL
    assert int(detector.provenance["frames"]) > 0


def test_a_path(tmp_path):
    path = tmp_path / "mine.safetensors"
    save_checkpoint(SecondNet(SMALL), path, {})
    assert isinstance(load_detector(str(path)), Second)


class Mine:
    classes = ("car",)
    range_m = Range(-1, -1, -1, 1, 1, 1)

    def detect(self, cloud):
        raise NotImplementedError

    def loss(self, points, boxes, labels):
        return torch.zeros(())


class NoDetector:
    pass


@pytest.fixture
def module(monkeypatch):
    module = types.ModuleType("my_detectors")
    module.Mine, module.NoDetector = Mine, NoDetector
    monkeypatch.setitem(sys.modules, "my_detectors", module)


def test_a_class_of_the_users(module):
    assert isinstance(load_detector("my_detectors:Mine"), Mine)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("my_detectors:NoDetector", "is no detector"),
        ("my_detectors:Missing", "cannot load detector"),
        ("no_such_module:Mine", "cannot load detector"),
        (":", "cannot load detector"),
        ("tiny", "unknown detector 'tiny'; known: small"),
        ("nowhere.safetensors", "no detector checkpoint at"),
    ],
)
def test_names_that_lead_nowhere(module, name, message):
    with pytest.raises(AdvpipeError, match=message):
        load_detector(name)
