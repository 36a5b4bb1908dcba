"""Imported weights of pointpillar.yaml and centerpoint_without_resnet.yaml, and what is refused by name."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.openpcdet import their_names
from advpipe.pipeline.detector.families import FAMILIES, family_named
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.iou import iou_bev


@pytest.fixture(scope="module")
def module():
    path = Path(__file__).parent / "openpcdet_reference.py"
    spec = importlib.util.spec_from_file_location("openpcdet_reference", path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.fixture
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def imported(net, family, folder, points):
    """Their network's weights by way of the command, in the named family; the detector, and its raw
    predictions for the points."""
    torch.save({"model_state": net.state_dict(), "epoch": 80}, folder / "theirs.pth")
    out = folder / "ours.safetensors"
    arguments = ["import-weights", str(folder / "theirs.pth"), "--out", str(out), "--family", family]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    detector = load_detector(str(out))
    with torch.no_grad():
        return detector, detector.net(detector.net.voxels([torch.from_numpy(points)]))


def street(seed, count, ground_m, spread_m=8):
    """Points (N, 4), dense enough near by that a voxel and a pillar hold more than the preset reads."""
    rng = np.random.default_rng(seed)
    x, y = rng.exponential(spread_m, count), rng.normal(0, 6, count)
    z = np.where(rng.random(count) < 0.6, ground_m, rng.uniform(ground_m, ground_m + 2.5, count))
    clump = [10, 2, ground_m + 0.2] + rng.uniform(0, 0.15, (300, 3))
    clump = np.column_stack([clump, rng.random(300)])
    return np.concatenate([np.column_stack([x, y, z, rng.random(count)]), clump]).astype(np.float32)


@pytest.mark.oracle
def test_imported_pillars_give_the_results_of_padded_ones(module, tmp_path, one_thread):
    theirs, points = module.randomise(module.PointPillar(), 5), street(1, 5000, -1.7)
    padded, cells = module.padded_pillars(points)
    assert (padded.abs().sum(2) > 0).sum(1).max() == 32  # one of them is full
    with torch.no_grad():
        expected = theirs(padded, cells)
    detector, ours = imported(theirs, "pointpillars", tmp_path, points)
    assert sum(weight.numel() for weight in detector.net.parameters()) == 4_834_888
    for mine, other in zip((ours.scores, ours.codes, ours.directions), expected, strict=True):
        assert other.std() > 0.05
        torch.testing.assert_close(mine, other, rtol=2e-4, atol=2e-4)


@pytest.mark.oracle
def test_imported_centres_give_the_results_of_spconv(module, tmp_path, one_thread):
    pytest.importorskip("spconv")
    theirs, points = module.randomise(module.build_centerpoint(), 6), street(2, 5000, 0.0)
    elongated = np.column_stack([points, np.zeros(len(points), np.float32)])
    grid = (-75.2, -75.2, -2.0), (0.1, 0.1, 0.15), (1504, 1504, 40)
    with torch.no_grad():
        expected = theirs(*module.mean_voxels(elongated, *grid))
    detector, ours = imported(theirs, "centerpoint", tmp_path, points)
    assert sum(weight.numel() for weight in detector.net.parameters()) == 5_775_803
    flat = {name: value[0].flatten(1).T for name, value in expected.items()}
    codes = torch.cat([flat[name] for name in ("center", "center_z", "dim", "rot")], dim=1)
    for mine, other in ((ours.scores[0], flat["hm"]), (ours.codes[0], codes)):
        assert other.std() > 0.05
        torch.testing.assert_close(mine, other, rtol=2e-4, atol=2e-4)

    # The best of all is decoded by hand, cell by cell; no other box that is kept overlaps it by more than .7.
    found = detector.net.cloud_detections(ours, 0)
    heat, code = torch.sigmoid(flat["hm"].double()).numpy(), codes.double().numpy()
    cells = np.arange(188 * 188)
    x = (cells % 188 + code[:, 0]) * 0.8 - 75.2
    y = (cells // 188 + code[:, 1]) * 0.8 - 75.2
    boxes = np.column_stack([x, y, code[:, 2], np.exp(code[:, 3:6]), np.arctan2(code[:, 7], code[:, 6])])
    inside = (np.abs(boxes[:, :2]) <= 75.2).all(1) & (boxes[:, 2] >= -2) & (boxes[:, 2] <= 4)
    candidates = np.sort(heat.ravel())[-500]  # those of OpenPCDet's top 500
    best = np.where(inside & (heat.max(1) >= candidates), heat.max(1), 0).argmax()
    assert found.scores[0] == pytest.approx(heat[best].max(), abs=1e-4)
    np.testing.assert_allclose(found.boxes[0], boxes[best], atol=2e-3)
    assert found.labels[0] == heat[best].argmax()
    assert 1 < len(found) <= 500
    assert (iou_bev(found.boxes[0], found.boxes[1:]) <= 0.7).all()


def state_of(family):
    """A state with OpenPCDet's names, and shapes that are not checked before the names are."""
    net = family_named(family).network("waymo" if family == "centerpoint" else "kitti")
    names = [name for name in net.state_dict() if not name.endswith("num_batches_tracked")]
    return {their: torch.zeros(1) for name in names for their in their_names(name)}


@pytest.mark.parametrize("holds", FAMILIES)
@pytest.mark.parametrize("wanted", FAMILIES)
def test_a_file_of_another_family_says_which(tmp_path, holds, wanted):
    torch.save({"model_state": state_of(holds)}, tmp_path / "theirs.pth")
    message = rf"holds a \w+ of OpenPCDet's [a-z_]+\.yaml; pass --family {holds}"
    with pytest.raises(AdvpipeError, match="has shape" if holds == wanted else message) as caught:
        family_named(wanted).import_weights(tmp_path / "theirs.pth")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("family", "change", "name"),
    [
        ("second", {"roi_head.iou_layers.0.weight": (1,)}, r"a SECOND-IoU \(second_iou\.yaml\)"),
        ("second", {"roi_head.a": (1,), "pfe.b": (1,)}, r"a PV-RCNN \(pv_rcnn\.yaml\)"),
        ("second", {"roi_head.a": (1,), "point_head.b": (1,)}, r"a Part-A2 \(PartA2\.yaml\)"),
        ("second", {"roi_head.a": (1,)}, r"a Voxel R-CNN \(voxel_rcnn_car\.yaml\)"),
        (
            "second",
            {"dense_head.rpn_heads.0.a": (1,)},
            r"second_multihead\.yaml, cbgs_second_multihead\.yaml",
        ),
        ("second", {"backbone_3d.conv_input.0.weight": (16, 3, 3, 3, 5)}, r"waymo_models/second\.yaml"),
        ("pointpillars", {"vfe.pfn_layers.0.linear.weight": (64, 11)}, r"pointpillar_1x\.yaml"),
        ("pointpillars", {"dense_head.rpn_heads.0.a": (1,)}, r"cbgs_pp_multihead\.yaml"),
        ("pointpillars", {"dense_head.heads_list.0.hm.0.0.weight": (1,)}, r"centerpoint_pillar_1x\.yaml"),
        ("pointpillars", {"backbone_3d.stage_0.0.weight": (1,)}, "DSVT or PillarNet"),
        ("centerpoint", {"vfe.pfn_layers.0.linear.weight": (64, 11)}, "DSVT or PillarNet"),
        ("centerpoint", {"backbone_3d.conv5.0.conv1.weight": (1,)}, "a VoxelNeXt"),
        ("second", {"vfe.ffn.ddn.model.weight": (1,)}, r"CaDDN\.yaml"),
        ("centerpoint", {"backbone_3d.conv1.0.conv1.weight": (1,)}, r"residual layers \(centerpoint\.yaml\)"),
        ("centerpoint", {"dense_head.heads_list.0.vel.0.0.bias": (1,)}, "nuScenes"),
        ("centerpoint", {"dense_head.heads_list.0.hm.1.weight": (5, 64, 3, 3)}, r"once_models/centerpoint"),
        ("second", {"dense_head.conv_cls.weight": (50, 512, 1, 1)}, r"once_models/second"),
        ("pointpillars", {"dense_head.conv_cls.weight": (50, 384, 1, 1)}, r"other classes than KITTI's"),
        ("second", {"backbone_3d.conv1.0.conv1.weight": (1,)}, "a SECOND with residual layers"),
        ("second", {"dense_head.decoder.self_attn.bias": (1,)}, "TransFusion"),
        ("second", {"backbone_3d.SA_modules.0.mlps.0.0.weight": (1,)}, "3DSSD or IA-SSD"),
    ],
)
def test_other_configurations_are_refused_by_name(tmp_path, family, change, name):
    state = state_of(family) | {weight: torch.zeros(shape) for weight, shape in change.items()}
    torch.save({"model_state": state}, tmp_path / "theirs.pth")
    with pytest.raises(AdvpipeError, match=name) as caught:
        family_named(family).import_weights(tmp_path / "theirs.pth")
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(
        "what is: second.yaml (KITTI); pointpillar.yaml (KITTI); centerpoint_without_resnet.yaml (Waymo)"
    )
