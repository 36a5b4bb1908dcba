"""The site builds without a warning, and its catalogues hold every registered attack."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from advpipe.stages.attack.registry import ATTACKS

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_attack_is_in_a_catalogue(site: Path) -> None:
    """Those of a newcomer too: nobody has to write a page for one."""
    pages = [
        (site / f"{name}.html").read_text(encoding="utf-8") for name in ("lidar-attacks", "v2x-gnss-attacks")
    ]
    linked = set(re.findall(r'<a href="#([a-z-]+)"><code>\1</code></a>', "".join(pages)))
    assert linked == set(ATTACKS)
    assert all(re.search(rf'<h3 id="{name}"', "".join(pages)) for name in ATTACKS)


def test_names_of_the_data_sets_stand_beside_their_attacks(site: Path) -> None:
    page = (site / "v2x-gnss-attacks.html").read_text(encoding="utf-8")
    (row,) = [
        row for row in re.findall(r"<tr>.*?</tr>", page, re.DOTALL) if 'href="#cam-eventual-stop"' in row
    ]
    assert "<td>16 eventual stop</td>" in row
    assert "<td>9 eventual stop</td>" in row


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    """The site opens without a network; links lead where they lead."""
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img)[^>]+src="https?:|<link[^>]+stylesheet[^>]+https?:', text), (
            path
        )
