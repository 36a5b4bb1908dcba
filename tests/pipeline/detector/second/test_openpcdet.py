"""Imported OpenPCDet checkpoints: the numbers that spconv computes, and refusals in one line."""

from __future__ import annotations

import importlib.util
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.openpcdet import their_names
from advpipe.pipeline.detector.common.voxels import voxelise
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.family import SecondFamily
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import KITTI

HERE = Path(__file__).parent


def reference():
    spec = importlib.util.spec_from_file_location(
        "openpcdet_reference", HERE.parent / "openpcdet_reference.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def their_state(spconv: int = 2) -> dict[str, torch.Tensor]:
    """A state with OpenPCDet's names and shapes, by its author's layout, without spconv."""
    state, ours = {"global_step": torch.zeros(1, dtype=torch.int64)}, SecondNet(KITTI).state_dict()
    for name, value in ours.items():
        names = their_names(name)
        if name.endswith("num_batches_tracked"):
            state[names[0]] = value
        elif name.startswith("head"):
            state |= dict(zip(names, torch.split(value, [18, 42, 12]), strict=True))
        elif value.ndim == 3:
            kernel = (3, 1, 1) if len(value) == 3 else (3, 3, 3)
            weight = value.view(*kernel, *value.shape[1:])
            state[names[0]] = weight.permute(4, 0, 1, 2, 3) if spconv == 2 else weight
        else:
            state[names[0]] = value
    return state


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("openpcdet") / "second.pth"
    torch.save({"model_state": their_state(), "epoch": 80, "it": 74240, "version": "pcdet+0.6.0"}, path)
    return path


def street(seed: int, count: int = 6000) -> np.ndarray:
    """Points (N, 4) dense enough near by that some voxels hold more than five."""
    rng = np.random.default_rng(seed)
    x, y = rng.exponential(8, count), rng.normal(0, 6, count)
    z = np.where(rng.random(count) < 0.6, -1.7, rng.uniform(-1.7, 1.2, count))
    clump = np.column_stack([rng.uniform([10, 2, -1.5], [10.2, 2.2, -1.3], (300, 3)), rng.random(300)])
    return np.concatenate([np.column_stack([x, y, z, rng.random(count)]), clump]).astype(np.float32)


@pytest.mark.oracle
def test_imported_weights_give_the_results_of_spconv(tmp_path):
    pytest.importorskip("spconv")
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        module = reference()
        theirs = module.randomise(module.build_second(), 3)
        points = street(0)
        features, indices = module.mean_voxels(
            points, (0.0, -40.0, -3.0), (0.05, 0.05, 0.1), (1408, 1600, 40)
        )
        with torch.no_grad():
            expected = theirs(features, indices)
        whole = {"model_state": theirs.state_dict(), "optimizer_state": None, "epoch": 1}
        torch.save(whole, tmp_path / "second.pth")
        out = tmp_path / "kitti.safetensors"
        done = CliRunner().invoke(app, ["import-weights", str(tmp_path / "second.pth"), "--out", str(out)])
        assert done.exit_code == 0, done.output
        detector = load_detector(str(out))
        voxels = voxelise([torch.from_numpy(points)], KITTI)
        assert len(voxels.sites) == len(indices)
        with torch.no_grad():
            ours = detector.net(voxels)
        for mine, other in zip((ours.scores, ours.codes, ours.directions), expected, strict=True):
            assert other.std() > 0.05
            torch.testing.assert_close(mine, other, rtol=1e-4, atol=1e-4)
        found = detector.detect_batch([torch.from_numpy(points)])[0]
        boxes, scores, labels = module.decode(*(part[0] for part in expected))
        # Each is one anchor's box as decoded by hand, and the best of all comes first.
        assert 20 < len(found) <= 500
        assert found.scores[0] == pytest.approx(scores.max(), abs=1e-4)
        for box, score, label in list(zip(found.boxes, found.scores, found.labels, strict=True))[:30]:
            difference = np.abs(boxes[:, :6] - box[:6]).max(1)
            (row,) = np.flatnonzero((difference < 2e-2) & (np.abs(scores - score) < 1e-4))[:1]
            assert labels[row] == label
            assert np.cos(boxes[row, 6] - box[6]) == pytest.approx(1, abs=1e-4)
    finally:
        torch.set_num_threads(threads)


def test_every_weight_is_mapped_once():
    state = their_state()
    names = [their for name in SecondNet(KITTI).state_dict() for their in their_names(name)]
    assert sum(not name.endswith("num_batches_tracked") for name in names) == len(
        {name for name in names if not name.endswith("num_batches_tracked")}
    )
    assert state["backbone_3d.conv4.0.0.weight"].shape == (64, 3, 3, 3, 64)
    assert state["backbone_3d.conv_out.0.weight"].shape == (128, 3, 1, 1, 64)
    assert state["backbone_2d.blocks.1.16.weight"].shape == (256, 256, 3, 3)
    assert state["backbone_2d.deblocks.1.0.weight"].shape == (256, 256, 2, 2)
    assert state["dense_head.conv_dir_cls.bias"].shape == (12,)


@pytest.mark.parametrize("layout", [1, 2])
def test_layouts_of_both_spconv_versions_give_the_same_weights(tmp_path, layout):
    torch.manual_seed(4)
    torch.save({"model_state": their_state(layout)}, tmp_path / "a.pth")
    net, provenance = SecondFamily().import_weights(tmp_path / "a.pth")
    torch.manual_seed(4)
    expected = SecondNet(KITTI).state_dict()
    for name, value in net.state_dict().items():
        if name != "backbone2d.blocks.0.0.weight":
            assert torch.equal(value, expected[name]), name
    # Channel 128 d + c here is channel 2 c + d there.
    first = expected["backbone2d.blocks.0.0.weight"]
    for c, d in ((0, 0), (1, 0), (5, 1), (127, 1)):
        assert torch.equal(net.backbone2d.blocks[0][0].weight[:, 128 * d + c], first[:, 2 * c + d])
    assert len(provenance["source_sha256"]) == 64


def changed(path: Path, checkpoint: Path, change) -> Path:
    whole = torch.load(checkpoint, weights_only=True)
    change(whole["model_state"])
    torch.save(whole, path)
    return path


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.pop("dense_head.conv_box.bias"), "lacks dense_head.conv_box.bias"),
        (lambda s: s.update({"vfe.pfn.weight": torch.zeros(2)}), "it has vfe.pfn.weight"),
        (
            lambda s: [s.pop(name) for name in list(s) if name.startswith("backbone_3d")],
            r"lacks backbone_3d.conv1.0.0.weight, .* and \d+ more",
        ),
        (
            lambda s: s.update({"dense_head.conv_cls.weight": torch.zeros(18, 256, 1, 1)}),
            r"conv_cls.weight has shape \(18, 256, 1, 1\), not \(18, 512, 1, 1\)",
        ),
        (
            lambda s: s.update({"backbone_3d.conv_input.0.weight": torch.zeros(16, 3, 3, 3, 7)}),
            r"conv_input.0.weight has shape \(16, 3, 3, 3, 7\), not \(16, 3, 3, 3, 4\)",
        ),
        (lambda s: s["dense_head.conv_cls.bias"].fill_(float("nan")), "conv_cls.bias holds values"),
        (
            lambda s: s.update({"dense_head.conv_cls.bias": torch.full((18,), 1e300, dtype=torch.float64)}),
            "conv_cls.bias holds values",
        ),
        (
            lambda s: s.update({"dense_head.conv_cls.bias": torch.zeros(18).to_sparse()}),
            "conv_cls.bias holds values",
        ),
        (lambda s: s.update({"dense_head.conv_cls.bias": 3.0}), "no `model_state` of tensors"),
    ],
)
def test_other_networks_are_refused(tmp_path, checkpoint, change, message):
    with pytest.raises(AdvpipeError, match=message) as caught:
        SecondFamily().import_weights(changed(tmp_path / "other.pth", checkpoint, change))
    assert "\n" not in str(caught.value)


class Harmful:
    """A pickle of it runs a command when loaded without care."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def test_code_in_a_file_is_never_run(tmp_path):
    trap = tmp_path / "it-ran"
    for number, (write, message) in enumerate(
        [
            (lambda path: torch.save({"model_state": Harmful(trap)}, path), "could run code"),
            (lambda path: torch.save(torch.nn.Linear(2, 2), path), "holds torch.nn.modules.linear.Linear"),
            (lambda path: path.write_bytes(pickle.dumps(Harmful(trap), protocol=2)), "torch.save"),
        ]
    ):
        path = tmp_path / f"{number}.pth"
        write(path)
        with pytest.raises(AdvpipeError, match=message) as caught:
            SecondFamily().import_weights(path)
        assert "\n" not in str(caught.value)
    assert not trap.exists()


def test_files_that_are_no_checkpoint_are_refused(tmp_path, checkpoint):
    whole = checkpoint.read_bytes()
    old = tmp_path / "old.pth"
    torch.save({"model_state": their_state()}, old, _use_new_zipfile_serialization=False)
    contents = [
        b"",
        b"no pickle at all",
        whole[:100],
        whole[:300_000],
        whole[:-200],
        old.read_bytes()[:300_000],
    ]
    contents.append(b"\x93NUMPY" + bytes(200))
    for number, content in enumerate(contents):
        path = tmp_path / f"{number}.pth"
        path.write_bytes(content)
        with pytest.raises(AdvpipeError, match=r"torch\.save") as caught:
            SecondFamily().import_weights(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(AdvpipeError, match="no OpenPCDet checkpoint at"):
        SecondFamily().import_weights(tmp_path / "missing.pth")
    torch.save([1, 2], tmp_path / "list.pth")
    with pytest.raises(AdvpipeError, match="no `model_state`"):
        SecondFamily().import_weights(tmp_path / "list.pth")
    assert len(SecondFamily().import_weights(old)[0].state_dict()) > 100


def test_the_command_refuses_before_reading_the_file(tmp_path, checkpoint):
    out = tmp_path / "out.safetensors"
    out.write_bytes(b"mine")
    for arguments, message in [
        ([str(checkpoint), "--out", str(out)], "already exists"),
        ([str(checkpoint), "--out", str(tmp_path / "out.pth")], "must end in .safetensors"),
        ([str(tmp_path / "none"), "--out", str(tmp_path / "x.safetensors")], "no OpenPCDet checkpoint at"),
    ]:
        done = CliRunner().invoke(app, ["import-weights", *arguments])
        assert done.exit_code == 2
        assert message in done.output
    assert out.read_bytes() == b"mine"
    assert not (tmp_path / "x.safetensors").exists()
