"""Bags of the small drive in `place_drive`, clean and attacked."""

import json
import sys
from pathlib import Path

import pytest

from advpipe.pipeline.bag.provenance import parent_sha256

sys.path.insert(0, str(Path(__file__).parent))

from place_drive import FRAMES, clean_cloud, write_bag


@pytest.fixture(scope="session")
def clean(tmp_path_factory):
    clouds = {index: clean_cloud(index) for index in range(FRAMES)}
    return write_bag(tmp_path_factory.mktemp("drive") / "clean", {"kind": "clean"}, clouds)


@pytest.fixture
def no_pictures(monkeypatch):
    """For tests of figures and tables: the pictures of each bag take half the time of a small evaluation."""
    monkeypatch.setattr("advpipe.stages.evaluate.report.pictures._bag_pictures", lambda *_, **__: ())
    monkeypatch.setattr("advpipe.stages.evaluate.report.pictures._clean_pictures", lambda *_, **__: ())


@pytest.fixture
def attacked(clean, tmp_path):
    """Make an adversarial bag of a change to the clouds."""
    return _attacked_in(clean, tmp_path)


@pytest.fixture(scope="module")
def attacked_once(clean, tmp_path_factory):
    """The same for what the tests of a module share."""
    return _attacked_in(clean, tmp_path_factory.mktemp("attacked"))


def _attacked_in(clean, folder):
    def make(change, name="attacked", frames=range(FRAMES), **provenance):
        about = {
            "kind": "attack",
            "attack": "detach",
            "recipe": "best",
            "parameters": json.dumps({"ratio": 0.014, "rounds": 10}),
            "parent_sha256": parent_sha256(clean),
        } | {"frames" if key == "slice" else key: value for key, value in provenance.items()}
        return write_bag(folder / name, about, {index: change(clean_cloud(index)) for index in frames})

    return make
