"""`advpipe clean`: it lists, keeps what is of use, and removes the rest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import CLOCK


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["clean", *arguments])
    return result.exit_code, result.output


def cut_off(town: Path) -> Path:
    """A recording whose run was killed: whole chunks, no end."""
    whole = town.parent / "whole"
    with BagWriter(whole, provenance=clean_provenance("town", "", 7, "")) as bag:
        for stamp_ns in range(1, 10):
            bag.write(CLOCK, build.clock(stamp_ns), stamp_ns)
    data = (whole / "whole_0.mcap").read_bytes()
    hidden = town.parent / f".{town.name}.partial-abcdefgh"
    (hidden / "clean").mkdir(parents=True)
    (hidden / ".lock").touch()
    (hidden / "clean" / "clean_0.mcap").write_bytes(data[:-200])
    return hidden


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording cut off, a job to go on from, and a half report."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    cut_off(tmp_path / "datasets" / "town")
    for name in (
        "datasets/town/.adv.0123456789ab.job/000000.npz",
        "datasets/.r.partial-abcdefgh/report.json",
    ):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).parent.joinpath(".lock").touch()
        (tmp_path / name).write_bytes(b"x" * 1000)
    return tmp_path


def test_it_lists_alone_and_says_what_is_of_use(tree: Path) -> None:
    before = sorted(tree.rglob("*"))
    code, out = run()
    assert code == 0
    assert "advpipe recover datasets/.town.partial-abcdefgh` saves it" in out
    assert "1 finished frames of datasets/town/adv: running the same command again resumes there" in out
    assert "half of datasets/r: of no use" in out
    assert "3 in all" in out
    assert (
        "--remove deletes 1 that nothing can use; --remove --all also deletes 2 that can still be used"
        in out.replace("\n", " ")
    )
    assert sorted(tree.rglob("*")) == before


def test_remove_keeps_what_is_of_use_unless_all_goes(tree: Path) -> None:
    assert run("--remove")[0] == 0
    names = {path.name for path in tree.rglob(".*")}
    assert {".town.partial-abcdefgh", ".adv.0123456789ab.job"} <= names
    assert ".r.partial-abcdefgh" not in names
    assert "2 of 2 removed" in run("--remove", "--all")[1]
    assert not list(tree.rglob(".*"))
    assert run() == (0, "no leftovers of killed runs\n")
    assert (tree / "datasets" / "whole").is_dir()


def test_a_leftover_that_is_named_goes(tree: Path) -> None:
    named = "datasets/.town.partial-abcdefgh"
    assert run(named, "--remove")[0] == 0
    assert not (tree / named).exists()
    assert (tree / "datasets/town/.adv.0123456789ab.job").exists()


def test_programs_read_it(tree: Path) -> None:
    found = {each["path"]: each for each in json.loads(run("datasets", "--json", "--quiet")[1])["leftovers"]}
    assert found["datasets/town/.adv.0123456789ab.job"] == {
        "path": "datasets/town/.adv.0123456789ab.job",
        "kind": "job",
        "belongs_to": "datasets/town/adv",
        "bytes": 1000,
        "frames": 1,
        "running": False,
        "use": "resume",
        "removed": False,
    }
    assert {each["use"] for each in found.values()} == {"resume", "recover", None}
    assert json.loads(run("datasets/whole", "--json", "--quiet")[1]) == {"leftovers": []}


def test_a_linked_folder_of_data_sets_is_looked_into(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tree / "disk").mkdir()
    (tree / "datasets").rename(tree / "disk" / "datasets")
    (tree / "here").mkdir()
    (tree / "here" / "datasets").symlink_to(tree / "disk" / "datasets")
    monkeypatch.chdir(tree / "here")
    assert "3 in all" in run()[1]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["nowhere"], "nowhere does not exist; give a folder to look below"),
        (["datasets/whole/metadata.yaml"], "is no folder"),
        (["--all"], "--all needs --remove"),
        (["datasets/.town.partial-abcdefgh/clean"], "give that folder"),
    ],
)
def test_what_it_refuses(tree: Path, arguments: list[str], line: str) -> None:
    result = CliRunner().invoke(app, ["clean", *arguments])
    assert result.exit_code == 2
    assert line in result.output
    assert len(result.output.splitlines()) == 1
