"""The pages are carried out from top to bottom; the site builds without a warning, with every attack."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import blocks
import pytest
from carry_out import carry_out, command
from mkdocs.__main__ import cli as mkdocs

from advpipe.pipeline.detector.families import FAMILIES
from advpipe.stages.attack.registry import ATTACKS

PAGES = sorted({block.page for block in blocks.of("python")} | set(blocks.RUN))
SMOKE = "advpipe simulate smoke --set v2x.penetration=1"
"""Long enough that vehicles hear one another."""


@pytest.fixture(scope="module")
def one_processor() -> Iterator[None]:
    """Commands start no workers then, which would load the libraries again."""
    before = os.sched_getaffinity(0) if hasattr(os, "sched_setaffinity") else set()
    if before:
        os.sched_setaffinity(0, {min(before)})
    yield
    if before:
        os.sched_setaffinity(0, before)


@pytest.fixture(scope="module")
def data_sets(tmp_path_factory: pytest.TempPathFactory, one_processor: None) -> Path:
    """`datasets/smoke`, on which the pages work, and its report."""
    folder = tmp_path_factory.mktemp("pages")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        command(SMOKE.split())
        command(["advpipe", "evaluate", "datasets/smoke", "--frames", "0:1"])
    return folder / "datasets"


@pytest.mark.parametrize("page", PAGES)
def test_pages_run(page: str, data_sets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of its own: files are written, Python and the commands carried out."""
    shutil.copytree(data_sets, tmp_path / "datasets")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    families = dict(FAMILIES)
    for module in ("advpipe.pipeline.detector.families", "advpipe.networks"):
        monkeypatch.setattr(f"{module}.FAMILIES", families)
    carry_out(page)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(blocks.ROOT)
        mkdocs(["build", "--strict", "--quiet", "--site-dir", str(folder)], standalone_mode=False)
    return folder


def test_every_attack_is_in_a_catalogue(site: Path) -> None:
    """Those of a newcomer too: nobody has to write a page for one."""
    names = ("lidar-attacks", "v2x-gnss-attacks", "radar", "camera")
    pages = [(site / f"{name}.html").read_text(encoding="utf-8") for name in names]
    linked = set(re.findall(r'<a href="#([a-z-]+)"><code>\1</code></a>', "".join(pages)))
    assert linked == set(ATTACKS)
    assert all(re.search(rf'<h3 id="{name}"', "".join(pages)) for name in ATTACKS)


def test_names_of_the_data_sets_stand_beside_their_attacks(site: Path) -> None:
    page = (site / "v2x-gnss-attacks.html").read_text(encoding="utf-8")
    row, *presets = [
        row for row in re.findall(r"<tr>.*?</tr>", page, re.DOTALL) if 'href="#cam-eventual-stop"' in row
    ]
    assert "<td>16 eventual stop</td>" in row
    assert "<td>9 eventual stop</td>" in row
    catalogues = [re.findall(r"<td><code>(\w+)</code></td>", preset) for preset in presets]
    assert catalogues == [["veremi"], ["f2md"]]


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    """The site opens without a network; links lead where they lead."""
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img)[^>]+src="https?:|<link[^>]+stylesheet[^>]+https?:', text), (
            path
        )
