"""`advpipe figures`: each figure of a report in the format that was asked for, and clear refusals."""

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure as PlainFigure
from typer.testing import CliRunner

from advpipe.pipeline.cli import app
from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import OVERVIEW


def drawn() -> PlainFigure:
    figure = Figure()
    figure.add_subplot().plot([0, 1], [1, 0])
    return figure


@pytest.fixture
def report(tmp_path: Path) -> Path:
    """The figures of a report as `evaluate` writes them."""
    folder = tmp_path / "first"
    (folder / "figures").mkdir(parents=True)
    (folder / "report.json").write_text("{}")
    (folder / "report.html").write_text("")
    for name in ("one", "two"):
        for file_name, content in picture_of(OVERVIEW, "", f"{name}.png", "", drawn()).files.items():
            (folder / "figures" / file_name).write_bytes(content)
    return folder


@pytest.mark.parametrize(("form", "start"), [("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")])
@pytest.mark.parametrize("named", ["", "report.html"])
def test_each_format(report: Path, form: str, start: bytes, named: str) -> None:
    done = CliRunner().invoke(app, ["figures", str(report / named), "--format", form, "--json"])
    assert done.exit_code == 0, done.output
    out = report.with_name(f"first-{form}")
    assert json.loads(done.stdout)["figures"] == [str(out / f"{name}.{form}") for name in ("one", "two")]
    assert [path.read_bytes()[: len(start)] for path in sorted(out.iterdir())] == [start] * 2


def test_an_old_folder_is_replaced_only_when_told(report: Path, tmp_path: Path) -> None:
    command = ["figures", str(report), "--out", str(tmp_path / "paper")]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert CliRunner().invoke(app, command).exit_code == 2
    assert CliRunner().invoke(app, [*command, "--overwrite"]).exit_code == 0


@pytest.mark.parametrize(
    ("spoil", "options", "reason"),
    [
        (lambda report: (report / "report.json").unlink(), [], "is not a report"),
        (lambda report: [each.unlink() for each in report.glob("figures/*.svg")], [], "no figures as SVG"),
        (lambda report: (report / "figures/one.svg").write_text("<svg/>"), [], "one.svg is not a drawing"),
        (lambda report: None, ["--format", "eps"], "unknown format 'eps'"),
    ],
)
def test_what_cannot_be_written(report: Path, spoil, options, reason) -> None:
    spoil(report)
    done = CliRunner().invoke(app, ["figures", str(report), *options])
    assert done.exit_code in (1, 2)
    assert reason in " ".join(done.output.split())
    assert not report.with_name("first-pdf").exists()


def test_the_same_figure_has_the_same_bytes() -> None:
    one, two = (picture_of(OVERVIEW, "", "a.png", "", drawn()) for _ in range(2))
    assert one.files == two.files
