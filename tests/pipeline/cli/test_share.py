"""`advpipe share` and `advpipe unpack` as a user types them."""

from __future__ import annotations

from pathlib import Path

import pytest
from first_words import without_progress
from typer.testing import CliRunner

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.topics import SCENARIO_INFO


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One message, recorded on a machine whose paths nobody needs to know."""
    scenario = "description: small\nmap: {opendrive: /home/me/Town06.xodr}\n"
    with BagWriter(tmp_path / "town" / "clean", provenance={"kind": "clean", "scenario": scenario}) as bag:
        bag.write(SCENARIO_INFO, string("{}"), 10**18)
    monkeypatch.chdir(tmp_path)
    return Path("town")


def test_share_and_unpack(dataset: Path) -> None:
    result = CliRunner().invoke(app, ["share", str(dataset), "--citation", "A. Author"])
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[0] == "shared/town"
    assert "no licence is stated" in result.stderr
    assert "hold paths of the machine that made them, such as /home/me/Town06.xodr" in result.stderr
    assert "A. Author" in Path("shared/town/README.md").read_text(encoding="utf-8")

    arguments = ["share", "town", "--out", "town.tar", "--split-mb", "1", "--licence", "CC0-1.0"]
    result = CliRunner().invoke(app, arguments)
    assert result.stdout.splitlines()[:2] == ["town.tar.000", "town.tar.sha256"]
    result = CliRunner().invoke(app, ["unpack", "town.tar", "--out", "again"])
    assert result.stdout.startswith("data set: again\nnext:     ")
    clean = Path("clean/clean_0.mcap")
    assert (Path("again") / clean).read_bytes() == (dataset / clean).read_bytes()


def test_mistakes_cost_one_line(dataset: Path) -> None:
    CliRunner().invoke(app, ["share", "town"])
    for arguments, message in (
        (["share", "town"], "shared/town already exists; pass --overwrite"),
        (["share", "town", "--out", "x", "--split-mb", "1"], "end the output's name in .tar, as in x.tar"),
        (["share", "town", "--out", "x", "--sign", "none.pem"], "none.pem: the key cannot be read"),
        (["unpack", "none.tar"], "neither none.tar nor none.tar.000 exists"),
    ):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 2
        assert message in result.stderr
        assert without_progress(result.stderr).count("\n") == 1
        assert not Path("x").exists()
