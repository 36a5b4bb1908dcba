from __future__ import annotations

import hashlib
import subprocess
import sys
import types
from pathlib import Path

import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.checkpoint import save_checkpoint
from advpipe.pipeline.detector.families import FAMILIES, shipped_checkpoints
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.second import model
from advpipe.pipeline.detector.second.family import SHIPPED
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL


@pytest.mark.parametrize(
    ("name", "family", "drives"),
    [("small", "second", 92), ("pointpillars", "pointpillars", 37), ("centerpoint", "centerpoint", 37)],
)
def test_shipped_detectors_are_loaded_by_name(name, family, drives):
    detector = load_detector(name)
    assert detector.net.preset == FAMILIES[family].preset("small")
    assert int(detector.provenance["frames"]) == drives * 60
    file = shipped_checkpoints()[name]
    assert file.stat().st_size < 4e6
    assert (file.parent / "MODEL_CARD.md").is_file()


def test_a_checkpoint_is_loaded_by_path(tmp_path):
    path = tmp_path / "mine.safetensors"
    save_checkpoint(SecondNet(SMALL), path, {})
    assert isinstance(load_detector(str(path)), Second)


def test_the_name_of_a_family_is_answered_with_what_to_give():
    what_to_give = "; give one of its checkpoints: small, FILE.safetensors of `advpipe train --family second`"
    with pytest.raises(AdvpipeError, match=what_to_give):
        load_detector("second")


class Mine:
    classes = ("car",)
    range_m = Range(-1, -1, -1, 1, 1, 1)

    def detect(self, cloud):
        raise AssertionError("not used in this test")

    def loss(self, points, boxes, labels):
        return torch.zeros(())


class NoDetector:
    pass


class WithOtherClasses(Mine):
    classes = ("car", "Bus")


class WithoutItsWeights(Mine):
    def __init__(self):
        raise RuntimeError("no weights at hand")


@pytest.fixture
def module(monkeypatch):
    module = types.ModuleType("my_detectors")
    for detector in (Mine, NoDetector, WithOtherClasses, WithoutItsWeights):
        setattr(module, detector.__name__, detector)
    monkeypatch.setitem(sys.modules, "my_detectors", module)


def test_a_users_class_is_loaded(module):
    assert isinstance(load_detector("my_detectors:Mine"), Mine)


def test_a_class_in_the_working_directory_is_loaded(tmp_path):
    (tmp_path / "my.py").write_text(
        "class D:\n"
        "    classes, range_m = ('car',), None\n"
        "    def detect(self, cloud): ...\n"
        "    def loss(self, points, boxes, labels): ...\n"
    )
    # `-P` keeps the working directory off the path, as it is for an installed program.
    code = (
        "import sys; before = list(sys.path)\n"
        "from advpipe.pipeline.detector.registry import load_detector\n"
        "load_detector('small'); assert sys.path == before\n"
        "print(load_detector('my:D').classes)"
    )
    command = [sys.executable, "-I", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "('car',)\n", done.stderr


def sha256(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_the_identity_of_a_checkpoint_is_its_sha256(tmp_path):
    (tmp_path / "mine.safetensors").write_bytes(b"weights")
    assert detector_sha256(str(tmp_path / "mine.safetensors")) == hashlib.sha256(b"weights").hexdigest()
    assert detector_sha256("small") == sha256(SHIPPED["small"])


def test_the_identity_of_a_class_is_its_source_files_sha256(module):
    assert detector_sha256("advpipe.pipeline.detector.second.model:Second") == sha256(model.__file__)
    assert detector_sha256("builtins:int") == ""
    with pytest.raises(AdvpipeError, match="cannot load detector"):
        detector_sha256("my_detectors:Missing")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("my_detectors:NoDetector", "is not a detector"),
        ("my_detectors:WithOtherClasses", "Bus.*each must be one of car, truck, cyclist, pedestrian"),
        ("my_detectors:WithoutItsWeights", "cannot load detector .*RuntimeError: no weights at hand"),
        ("my_detectors:Missing", "cannot load detector"),
        ("no_such_module:Mine", "cannot load detector"),
        (":", "cannot load detector"),
        ("tiny", "unknown detector 'tiny'; known: small"),
        ("nowhere.safetensors", "no detector checkpoint at"),
    ],
)
def test_unknown_names_are_refused(module, name, message):
    with pytest.raises(AdvpipeError, match=message):
        load_detector(name)
