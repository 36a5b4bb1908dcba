"""A few inputs of each target, always the same ones: all are handled."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz import base
from tests.fuzz.findings import all_of
from tests.fuzz.registry import NAMES, target_named
from tests.fuzz.watch import Limits, Watch
from tests.fuzz.worker import Folder

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def documents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("smoke")
    base.build(out / "base")
    return out


@pytest.mark.parametrize("name", NAMES)
def test_a_few_inputs_are_handled(name: str, documents: Path) -> None:
    folder, inputs = Folder(documents / "work" / name), target_named(name).smoke_inputs
    folder.path.mkdir(parents=True)
    progress = Watch(name, engine="hypothesis", seed=0, folder=folder, limits=Limits(), inputs=inputs).run()
    found = [f"{one}\n{one.fault.trace}" for one in all_of(folder.findings) if one.target == name]
    assert (progress.inputs, found) == (inputs, [])
