"""The maps that a detector was trained on: the shipped list, and what checkpoints and classes report."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from advpipe.pipeline.detector.checkpoint import load_checkpoint, save_checkpoint
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.family import SHIPPED
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.detector.training_maps import KEY, MapList, is_training_map, list_beside, map_of
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.road_network.network import load_network

ROOT = Path(__file__).parents[3]
NETWORKS = ROOT / "scenarios" / "networks"
A, B, C = ("a" * 64, "b" * 64, "c" * 64)


@pytest.fixture(scope="module")
def training_maps() -> ModuleType:
    """benchmarks/training_maps.py, which made the list."""
    spec = importlib.util.spec_from_file_location("made", ROOT / "benchmarks" / "training_maps.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules["made"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


def shipped_list() -> MapList:
    return MapList.model_validate_json(list_beside(SHIPPED["small"]).read_bytes())


def test_the_list_belongs_to_the_shipped_checkpoint() -> None:
    known = shipped_list()
    assert known.checkpoint_sha256 == hashlib.sha256(SHIPPED["small"].read_bytes()).hexdigest()
    small = load_detector("small")
    for network in ("boulevard", "highway"):
        digest = hashlib.sha256((NETWORKS / f"{network}.net.xml").read_bytes()).hexdigest()
        assert known.maps_sha256[network] == digest
        assert is_training_map(small, digest) is True
    assert is_training_map(small, A) is False
    assert is_training_map(small, None) is None


@pytest.mark.parametrize("name", ["pointpillars", "centerpoint"])
def test_the_others_learned_from_some_of_these_maps(name: str) -> None:
    """Their checkpoints hold the maps themselves, of the drives that are not made again."""
    maps = json.loads(load_detector(name).provenance[KEY])  # type: ignore[attr-defined]
    listed = shipped_list().maps_sha256
    assert set(maps) == {listed[name] for name in listed if not name.endswith("-again")}


def test_the_list_has_every_drive_of_the_script(training_maps: ModuleType) -> None:
    """37, all of them twice, and 18 in the world before: as many as the checkpoint's own record names. Not
    those that it was validated on."""
    drives = {drive.name: drive for drive in training_maps.drives()}
    bags = json.loads(load_detector("small").provenance["bags_sha256"])  # type: ignore[attr-defined]
    assert set(drives) == set(shipped_list().maps_sha256)
    assert len(drives) == 2 * 37
    assert len(bags) == len(drives) + 18
    assert "valid" not in drives


@pytest.mark.parametrize("name", ["grid1", "open4", "rand1", "bikes8"])
def test_a_generated_map_is_reproducible(training_maps: ModuleType, name: str) -> None:
    """open4 with the speed of its own, rand1 by its seed; dates and paths in SUMO's files do not count."""
    (drive,) = [each for each in training_maps.drives() if each.name == name]
    assert training_maps.map_sha256(drive) == shipped_list().maps_sha256[name]


def test_a_copy_of_the_shipped_checkpoint_knows_its_maps_and_other_files_do_not(tmp_path: Path) -> None:
    copy, other = tmp_path / "mine.safetensors", tmp_path / "other.safetensors"
    shutil.copy(SHIPPED["small"], copy)
    save_checkpoint(SecondNet(SMALL), other, {})
    boulevard = shipped_list().maps_sha256["boulevard"]
    assert is_training_map(load_checkpoint(copy).detector(), boulevard) is True
    assert is_training_map(load_checkpoint(other).detector(), boulevard) is None


@pytest.mark.parametrize(
    ("listed", "seen", "unseen"),
    [
        (f'["{A}", "{B}"]', True, False),
        (f'["{A}", null]', True, None),  # some drives' maps are unknown
        ("[]", False, False),
        ("[null]", None, None),
        (f'["{A}", 7]', None, None),  # an invalid list is ignored
        (f'{{"{A}": 1}}', None, None),
        ('["short"]', None, None),
        ("[", None, None),
    ],
)
def test_a_checkpoint_reports_its_maps(
    tmp_path: Path, listed: str, seen: bool | None, unseen: bool | None
) -> None:
    path = tmp_path / "mine.safetensors"
    save_checkpoint(SecondNet(SMALL), path, {KEY: listed})
    detector = load_checkpoint(path).detector()
    assert (is_training_map(detector, A), is_training_map(detector, C)) == (seen, unseen)


def test_only_a_sha256_identifies_a_map() -> None:
    assert map_of({"map_sha256": A}) == A
    for provenance in ({}, {"map_sha256": ""}, {"map_sha256": A[1:]}, {"map_sha256": A + "\n"}):
        assert map_of(provenance) is None


def test_the_map_of_the_default_scenario_is_held_out(tmp_path: Path) -> None:
    """By its map, whatever the seed; and `make demo` records the same drive as `advpipe simulate`."""

    from advpipe.pipeline.cli.simulate import DEFAULT

    name = DEFAULT
    assert f"advpipe simulate {name} " in (ROOT / "Makefile").read_text()
    small, scenario = load_detector("small"), load_scenario(name)
    for seed in (scenario.simulation.seed, 101):
        assert is_training_map(small, load_network(scenario.map, tmp_path, seed).map_sha256) is False
