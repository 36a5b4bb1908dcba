"""Defences: their effect on a cloud, by hand and against Open3D; boxes are mapped back."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.defences.registry import DEFENCES, parse_defences
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyz

BOXES = np.array([[5.0, 3.0, 0.5, 4.0, 2.0, 1.5, 0.4], [-8.0, -2.0, 0.0, 6.0, 2.5, 3.0, -2.9]])


def cloud(n: int = 4000) -> np.ndarray:
    rng = np.random.default_rng(0)
    points = np.zeros(n, POINT_DTYPE)
    points["x"], points["y"], points["z"] = rng.normal(0, [6, 4, 1], (n, 3)).T
    points["intensity"], points["ring"] = rng.random(n), rng.integers(0, 64, n)
    points["time"] = np.arange(n) * -1e-5
    return points


def defend(text: str, points: np.ndarray, seed: int = 0):
    (defence,) = parse_defences([text]).values()
    return defence(points, np.random.default_rng(seed))


@pytest.mark.parametrize("defence", DEFENCES)
def test_every_defence_keeps_its_input_unchanged_and_depends_on_its_generator(defence):
    points = cloud()
    once, twice = defend(defence, points), defend(defence, points)
    assert (points == cloud()).all()
    assert (once.cloud == twice.cloud).all()
    assert once.cloud.dtype == POINT_DTYPE
    assert len(once.cloud) != len(points) or (xyz(once.cloud) != xyz(points)).any()


@pytest.mark.parametrize("defence", ["sample", "jitter", "shift"])
def test_another_seed_gives_another_cloud(defence):
    one, other = defend(defence, cloud()).cloud, defend(defence, cloud(), seed=1).cloud
    assert one.tobytes() != other.tobytes()


@pytest.mark.parametrize("defence", ["shift", "shift:2", "flip", "scale", "scale:0.8"])
def test_boxes_are_mapped_back_to_the_original_cloud(defence):
    """A box around the moved points, brought back, holds the points that it held there."""
    defended = defend(defence, cloud())
    there = points_in_boxes(xyz(defended.cloud), BOXES)
    back = defended.placement.boxes_back(BOXES)
    assert all(len(each) > 5 for each in there)
    assert (back != BOXES).any()
    for one, other in zip(there, points_in_boxes(xyz(cloud()), back, 1e-6), strict=True):
        assert np.array_equal(one, other)


def test_flip_and_scale_equal_values_computed_by_hand():
    (box,) = defend("flip", cloud()).placement.boxes_back(np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.7]]))
    assert box == pytest.approx([1.0, -2.0, 3.0, 4.0, 5.0, 6.0, -0.7])
    (box,) = defend("scale:2", cloud()).placement.boxes_back(np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.7]]))
    assert box == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 0.7])


def test_sampling_removes_exactly_its_share():
    kept = defend("sample:0.1", cloud()).cloud
    assert len(kept) == 3600
    assert set(kept["time"].tolist()) < set(cloud()["time"].tolist())


def test_quantisation_rounds_coordinates():
    points = cloud(3)
    points["x"], points["y"], points["z"] = [0.014, -0.016, 7.0], 0.0, 0.0049
    rounded = defend("quantise:0.01", points).cloud
    assert rounded["x"].tolist() == np.array([0.01, -0.02, 7.0], np.float32).tolist()
    assert rounded["z"].tolist() == [0.0, 0.0, 0.0]


def test_jitter_has_the_configured_standard_deviation():
    moved = xyz(defend("jitter:0.02", cloud()).cloud).astype(float) - xyz(cloud())
    assert moved.std(axis=0) == pytest.approx([0.02] * 3, rel=0.05)


@pytest.mark.oracle
@pytest.mark.parametrize(("k", "sigmas"), [(2, 1.1), (8, 2.0)])
def test_outliers_equal_those_of_open3d(k, sigmas):
    """Open3D counts the point itself among the neighbours: k + 1 of them, and all means shrink alike."""
    o3d = pytest.importorskip("open3d")
    tree = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz(cloud()).astype(float)))
    _, kept = tree.remove_statistical_outlier(k + 1, sigmas)
    ours = defend(f"outliers:k={k},sigmas={sigmas}", cloud()).cloud
    assert 0 < len(ours) < len(cloud())
    assert (ours == cloud()[np.sort(kept)]).all()


def test_outlier_removal_keeps_clouds_with_too_few_neighbours():
    assert len(defend("outliers", cloud(2)).cloud) == 2
    assert len(defend("outliers", cloud(0)).cloud) == 0
    points = cloud(200)
    points["x"][7] = np.nan
    assert np.isnan(defend("outliers", points).cloud["x"]).sum() == 1


def test_names_are_resolved_with_all_parameters():
    assert list(parse_defences(["jitter", "outliers:sigmas=2", "flip", "sample:0.2"])) == [
        "jitter:sigma_m=0.01",
        "outliers:k=2,sigmas=2",
        "flip",
        "sample:drop=0.2",
    ]


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (
            ["jiter"],
            r"unknown defence 'jiter'; did you mean 'jitter'\? known: sample, .* \(or your",
        ),
        (["jiter:0.1"], "unknown defence 'jiter'"),
        (["json:nothing"], "defence json:nothing cannot be loaded: AttributeError"),
        (["math:pi"], "defence math:pi is not a class"),
        (["fractions:Fraction:numerator=1,denominator=0"], "each parameter .* needs a number"),
        (["jitter:metres=1"], "parameter 'metres' is unknown; known: sigma_m"),
        (["flip:2"], "known: none"),
        (["jitter:much"], "sigma_m is 'much', but must be a number"),
        (["jitter:-1"], "finite and above 0"),
        (["quantise:nan"], "finite and above 0"),
        (["sample:1"], "between 0 and 1"),
        (["outliers:k=1.5"], "whole number"),
        (["outliers:sigmas=inf"], "finite"),
        (["jitter:1,sigma_m=2"], "'sigma_m' is given twice"),
        (["flip", "flip"], "flip is given twice"),
    ],
)
def test_invalid_defences_are_refused(texts, message):
    with pytest.raises(AdvpipeError, match=message) as caught:
        parse_defences(texts)
    assert "\n" not in str(caught.value)


OWN = """
from advpipe import DefendedCloud


class Keep:
    def __init__(self, *, count: float = 5):
        if count < 1:
            raise ValueError("count is too small")
        self.count = int(count)

    def __call__(self, cloud, rng):
        return DefendedCloud(cloud[: self.count]) if self.count < 100 else cloud
"""


def test_a_defence_of_the_users_own(tmp_path, monkeypatch):
    """Named by its class, with or without parameters; its mistakes are one-line errors."""
    (tmp_path / "own_defence.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [str(tmp_path), *sys.path])
    points = cloud()
    rng = np.random.default_rng(0)
    for defence, name, count in (("", ":count=5", 5), (":count=7", ":count=7", 7), (":3", ":count=3", 3)):
        (found,) = parse_defences([f"own_defence:Keep{defence}"]).items()
        assert found[0] == f"own_defence:Keep{name}"
        assert len(found[1](points, rng).cloud) == count
    with pytest.raises(AdvpipeError, match=r"own_defence:Keep failed: ValueError: count is too small"):
        parse_defences(["own_defence:Keep:0"])
    (too_many,) = parse_defences(["own_defence:Keep:100"]).values()
    with pytest.raises(AdvpipeError, match=r"failed: TypeError: returned ndarray instead of a DefendedCloud"):
        too_many(points, rng)


def test_words_for_several():
    default, every = parse_defences(["default"]), parse_defences(["all"])
    assert list(default) == list(every)[:-1]
    assert list(every)[-1] == "scale:factor=1.025"
    assert len(every) == len(DEFENCES)
    assert parse_defences(["none"]) == {}
    assert list(parse_defences(["default", "jitter:0.02"]))[-1] == "jitter:sigma_m=0.02"
    with pytest.raises(UsageError, match="defence none stands alone; leave out the others or it"):
        parse_defences(["none", "flip"])
    with pytest.raises(UsageError, match="defence flip is given twice"):
        parse_defences(["default", "flip"])
