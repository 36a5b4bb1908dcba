"""Checkpoints: the same detector comes back, and damaged files are refused in one line."""

from __future__ import annotations

import json

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.detector.checkpoint import load_checkpoint, save_checkpoint
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.detector.weights_file import MOST_BYTES


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(1)
    net = SecondNet(SMALL)
    path = tmp_path / "a.safetensors"
    save_checkpoint(net, path, {"seed": "7", "frames": "100"})
    return net, path


def test_a_checkpoint_round_trips(saved):
    net, path = saved
    assert path.stat().st_size < 2_850_000
    checkpoint = load_checkpoint(path)
    detector = checkpoint.detector()
    assert checkpoint.provenance == {"seed": "7", "frames": "100"}
    torch.manual_seed(0)
    points = torch.rand(500, 4) * torch.tensor([20.0, 20.0, 2.0, 1.0]) - torch.tensor([0.0, 0.0, 2.0, 0.0])
    boxes, labels = torch.tensor([[10.0, 10.0, -1.0, 4.5, 1.8, 1.6, 0.2]]), torch.tensor([0])
    before, after = (
        float(Second(net).loss(points, boxes, labels)),
        float(detector.loss(points, boxes, labels)),
    )
    assert after == pytest.approx(before, rel=1e-2)
    # Saved again, nothing more is lost, to the byte.
    again = path.with_name("b.safetensors")
    save_checkpoint(checkpoint.net, again, checkpoint.provenance)
    assert again.read_bytes() == path.read_bytes()


def test_a_checkpoint_without_a_family_is_a_second(saved):
    net, path = saved
    rewritten(path, lambda about, tensors: about.update(kind="advpipe-second-1", family="second"))
    with_family = load_checkpoint(path)
    rewritten(path, lambda about, tensors: about.pop("family"))
    assert isinstance(load_checkpoint(path).net, SecondNet)
    assert load_checkpoint(path).net.preset == with_family.net.preset == net.preset


def test_no_file_is_overwritten_unless_requested(saved):
    net, path = saved
    with pytest.raises(OutputExistsError):
        save_checkpoint(net, path, {})
    save_checkpoint(net, path, {}, overwrite=True)
    assert not list(path.parent.glob(".*"))


def rewritten(path, change):
    with safe_open(path, "pt") as file:
        about = json.loads(file.metadata()["advpipe"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    change(about, tensors)
    save_file(tensors, path, metadata={"advpipe": json.dumps(about)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda about, tensors: about.update(family="third"), "unknown detector family 'third'"),
        (lambda about, tensors: about.update(preset="huge"), "unknown detector preset 'huge'"),
        (lambda about, tensors: about.update(classes=["car"]), "train again"),
        (lambda about, tensors: about.update(kind="other"), "not a detector checkpoint of advpipe"),
        (lambda about, tensors: about.update(preset=["small"]), "not a detector checkpoint of advpipe"),
        (lambda about, tensors: about.update(classes=4), "not a detector checkpoint of advpipe"),
        (lambda about, tensors: about.update(provenance=None), "not a detector checkpoint of advpipe"),
        (lambda about, tensors: about.update(provenance={"seed": 7}), "advpipe: provenance.seed"),
        (lambda about, tensors: about.update(provenance={"a": float("nan")}), "not valid JSON: NaN"),
        (lambda about, tensors: about.update(provenance={"a": "\ud800"}), "surrogate"),
        (lambda about, tensors: about.update(preset="x" * 100_000), "advpipe: preset"),
        (lambda about, tensors: about.update(classes=[5]), "advpipe: classes.0"),
        (lambda about, tensors: next(iter(tensors.values())).view(-1)[:1].fill_(torch.nan), "not all finite"),
        (lambda about, tensors: tensors.popitem(), "do not fit"),
        (lambda about, tensors: tensors.update({"head.convolution.bias": torch.zeros(3)}), "do not fit"),
    ],
)
def test_checkpoints_of_other_presets_are_refused(saved, change, message):
    _, path = saved
    rewritten(path, change)
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 something else", "cut"])
def test_files_that_are_no_checkpoint_are_refused(saved, content):
    _, path = saved
    path.write_bytes(path.read_bytes()[:100_000] if content == "cut" else content)
    with pytest.raises(AdvpipeError, match="not a complete safetensors file") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


def test_other_safetensors_and_missing_files_are_refused(tmp_path):
    save_file({"a": torch.zeros(2)}, tmp_path / "x.safetensors")
    with pytest.raises(AdvpipeError, match="not a detector checkpoint of advpipe"):
        load_checkpoint(tmp_path / "x.safetensors")
    with pytest.raises(AdvpipeError, match="no detector checkpoint at"):
        load_checkpoint(tmp_path / "none.safetensors")


def test_declared_sizes_are_bounded_before_anything_is_read(saved, tmp_path):
    _, path = saved
    whole = path.read_bytes()
    for content, message in [
        ((1 << 40).to_bytes(8, "little") + whole[8:], "a header of 1099511627776 bytes"),
        ((1 << 21).to_bytes(8, "little") + b" " * (1 << 21), "a header of 2097152 bytes"),
    ]:
        path.write_bytes(content)
        with pytest.raises(AdvpipeError, match=message):
            load_checkpoint(path)
    with path.open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    with pytest.raises(AdvpipeError, match="advpipe's checkpoints have at most"):
        load_checkpoint(path)


def test_tensors_of_other_shapes_are_refused_by_the_header(saved, monkeypatch):
    _, path = saved
    rewritten(path, lambda about, tensors: tensors.update(more=torch.zeros(30_000_000, dtype=torch.int8)))
    monkeypatch.setattr(torch.Tensor, "float", lambda tensor: pytest.fail("was unpacked"))
    with pytest.raises(AdvpipeError, match="do not fit preset 'small'"):
        load_checkpoint(path)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"kind": ' * 50_000, "NaN", "[1]", "x" * 100_000])
def test_invalid_metadata_is_refused(saved, text):
    _, path = saved
    save_file({"a": torch.zeros(1)}, path, metadata={"advpipe": text})
    with pytest.raises(AdvpipeError, match="not a detector checkpoint of advpipe") as caught:
        load_checkpoint(path)
    assert len(str(caught.value)) < 300
