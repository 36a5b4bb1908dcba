"""Where results lie where no output is named, and outputs that exist."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import advpipe
from advpipe.commands.paths import default_output, refuse_existing
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import OutputExistsError


def test_a_bag_of_a_data_set_and_bare_ones(tmp_path: Path) -> None:
    file, folder = tmp_path / "town.mcap", tmp_path / "town.v2"
    file.touch()
    folder.mkdir()
    assert default_output(tmp_path / "clean", "detach-1") == tmp_path / "detach-1"
    assert default_output(file, "detach-1") == tmp_path / "town-detach-1"
    assert default_output(folder, "detach-1") == tmp_path / "town.v2-detach-1"
    assert default_output(file, "small", "reports") == tmp_path / "reports" / "town-small"


def test_existing_outputs(tmp_path: Path) -> None:
    refuse_existing(tmp_path / "new", overwrite=False)
    refuse_existing(tmp_path, overwrite=True)
    with pytest.raises(OutputExistsError, match="already exists"):
        refuse_existing(tmp_path, overwrite=False)


def test_two_bare_bags_in_a_folder_have_attacks_of_their_own(tmp_path: Path) -> None:
    for name in ("one", "two"):
        with BagWriter(tmp_path / name, provenance={}):
            pass
        existing = tmp_path / f"{name}-detach-best-0.01"
        existing.mkdir()
        with pytest.raises(advpipe.UsageError, match=rf"/{name}-detach-best-0.01 already exists"):
            advpipe.attack(tmp_path / name)
    (tmp_path / "reports" / "two-small").mkdir(parents=True)
    with pytest.raises(advpipe.UsageError, match=r"/reports/two-small already exists"):
        advpipe.evaluate(tmp_path / "two")


@pytest.mark.parametrize("call", ["attack('bag', out='.')", "evaluate('bag')", "simulate('smoke', out='.')"])
def test_an_output_that_exists_is_refused_before_anything_heavy_is_loaded(tmp_path: Path, call: str) -> None:
    with BagWriter(tmp_path / "bag", provenance={}):
        pass
    (tmp_path / "reports" / "bag-small").mkdir(parents=True)
    code = f"""
import sys, advpipe
try:
    advpipe.{call}
except advpipe.UsageError as error:
    print(error, [name for name in ("torch", "open3d", "scipy", "pyarrow") if name in sys.modules])
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.endswith("already exists; pass overwrite=True to replace it []\n")
