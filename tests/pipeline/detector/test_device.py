from __future__ import annotations

import sys
import types

import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.device import device_record, frames_at_once, open_device
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.registry import load_detector


def test_the_cpu_is_opened():
    assert open_device("cpu") == torch.device("cpu")


@pytest.mark.parametrize("name", ["gpu", "cuda:", "cuda:-1", "cuda:a", "CPU", "cpu:0", "mps", ""])
def test_an_unknown_device_is_refused(name):
    with pytest.raises(AdvpipeError, match=f"unknown device '{name}'; known: cpu, cuda, cuda:N"):
        open_device(name)


@pytest.mark.parametrize("name", ["cuda", "cuda:0", "cuda:1"])
def test_cuda_without_a_gpu_is_refused(name, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(AdvpipeError, match=rf"device {name}: .* finds no CUDA GPU; use device='cpu', or"):
        open_device(name)


def test_a_gpu_beyond_the_last_is_refused(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    with pytest.raises(AdvpipeError, match="device cuda:2: the last of 2 CUDA GPUs is cuda:1"):
        open_device("cuda:2")


def test_the_recorded_device_omits_the_cpu_and_the_index():
    assert [device_record(name) for name in ("cpu", "cuda", "cuda:3")] == [
        {},
        {"device": "cuda"},
        {"device": "cuda"},
    ]


def test_frames_are_batched_only_on_a_gpu():
    assert [frames_at_once(name) for name in ("cpu", "cuda", "cuda:3")] == [1, 8, 8]


class Plain:
    classes, range_m = ("car",), Range(-1, -1, -1, 1, 1, 1)
    device = None

    def detect(self, cloud): ...

    def loss(self, points, boxes, labels): ...


class Placed(Plain):
    def __init__(self, *, device):
        self.device = device


def test_a_class_gets_the_device_if_its_constructor_takes_one(monkeypatch):
    module = types.ModuleType("placed_detectors")
    module.Plain, module.Placed = Plain, Placed
    monkeypatch.setitem(sys.modules, "placed_detectors", module)
    assert load_detector("placed_detectors:Plain").device is None
    assert load_detector("placed_detectors:Placed").device == torch.device("cpu")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")
def test_the_shipped_detector_runs_on_a_gpu():
    assert load_detector("small", "cuda").device == open_device("cuda")
