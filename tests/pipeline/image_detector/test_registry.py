"""Image detectors by name, and checkpoints that come back as they were."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.image_detector.checkpoint import load_image_checkpoint, save_image_checkpoint
from advpipe.pipeline.image_detector.network import PRESETS, ImageNet
from advpipe.pipeline.image_detector.registry import (
    SHIPPED,
    differentiable_image_detector,
    image_detector_named,
    image_detector_sha256,
)

MOST_BYTES = 4_000_000


class Eye:
    classes = ("car",)

    def detect(self, image: object) -> object:
        raise AssertionError("not used in this test")


@pytest.fixture
def mine(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    module = types.ModuleType("my_eyes")
    monkeypatch.setitem(sys.modules, "my_eyes", module)
    module.Eye = Eye  # type: ignore[attr-defined]
    module.Bird = type("Bird", (Eye,), {"classes": ("bird",)})  # type: ignore[attr-defined]
    module.Blind = type("Blind", (), {"classes": ("car",)})  # type: ignore[attr-defined]
    return module


def test_the_shipped_detector_is_loaded_by_name() -> None:
    detector = differentiable_image_detector("small")
    assert detector.classes == ("car", "truck", "cyclist", "pedestrian")
    assert SHIPPED["small"].stat().st_size <= MOST_BYTES
    assert image_detector_sha256("small") == sha256_of(SHIPPED["small"])


def test_a_users_class_is_loaded(mine: types.ModuleType) -> None:
    assert isinstance(image_detector_named("my_eyes:Eye"), Eye)
    assert image_detector_sha256("my_eyes:Eye") == sha256_of(Path(__file__))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("smal", "unknown image detector 'smal'; .*small"),
        ("nowhere.safetensors", "no image detector's checkpoint at nowhere.safetensors"),
        ("my_eyes:Nobody", "cannot load image detector my_eyes:Nobody: AttributeError"),
        ("my_eyes:Bird", "has the classes .*'bird'.*; each must be one of car"),
        ("my_eyes:Blind", "my_eyes:Blind is not an image detector: it needs classes and detect"),
    ],
)
def test_what_is_no_detector_is_refused(mine: types.ModuleType, name: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        image_detector_named(name)


def test_attacks_refuse_a_detector_without_gradients(mine: types.ModuleType) -> None:
    with pytest.raises(UsageError, match="has no objectness"):
        differentiable_image_detector("my_eyes:Eye")


def test_a_checkpoint_comes_back(tmp_path: Path) -> None:
    torch.manual_seed(0)
    net, path = ImageNet(PRESETS["small"]), tmp_path / "eye.safetensors"
    save_image_checkpoint(net, path, {"seed": "0"})
    loaded = load_image_checkpoint(path)
    assert loaded.provenance == {"seed": "0"}
    for name, weights in net.state_dict().items():
        if weights.is_floating_point():
            torch.testing.assert_close(loaded.net.state_dict()[name], weights, atol=1e-3, rtol=1e-3)
    image = np.zeros((40, 40, 3), np.uint8)
    named = image_detector_named(str(path))
    assert named.detect(image).scores.tobytes() == loaded.detect(image).scores.tobytes()
    with pytest.raises(OutputExistsError):
        save_image_checkpoint(net, path, {})


def test_files_that_are_no_checkpoints_are_refused_in_one_line(tmp_path: Path) -> None:
    text, other, damaged = (tmp_path / f"{name}.safetensors" for name in ("text", "other", "damaged"))
    text.write_text("no weights")
    save_file({"a": torch.zeros(1)}, other)
    save_image_checkpoint(ImageNet(PRESETS["small"]), damaged, {})
    damaged.write_bytes(damaged.read_bytes()[:-100])
    for path, message in ((text, "complete"), (other, "not an image detector"), (damaged, "complete")):
        with pytest.raises(AdvpipeError, match=message) as refusal:
            load_image_checkpoint(path)
        assert "\n" not in str(refusal.value)
    from advpipe.pipeline.detector.registry import load_detector

    save_image_checkpoint(ImageNet(PRESETS["small"]), tmp_path / "eye.safetensors", {})
    with pytest.raises(AdvpipeError, match="not a detector checkpoint"):
        load_detector(str(tmp_path / "eye.safetensors"))
