"""The notebook is committed without outputs, runs from top to bottom, and shows what it computed.

It is run at night: test_commands.py calls the same functions in every run.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from advpipe import open_bag

NOTEBOOK = Path(__file__).parents[2] / "examples" / "first_attack.ipynb"


def read() -> Any:
    return nbformat.read(NOTEBOOK, as_version=4)


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, list[Any]]]:
    """The folder in which the notebook ran, and the outputs of its cells by their ids."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = read()
    NotebookClient(notebook, timeout=900, resources={"metadata": {"path": str(folder)}}).execute()
    return folder, {cell.id: cell.outputs for cell in notebook.cells if cell.cell_type == "code"}


def html(outputs: list[Any]) -> str:
    return "".join(output.data["text/html"] for output in outputs if "text/html" in output.get("data", {}))


def test_it_is_committed_without_outputs() -> None:
    code = [cell for cell in read().cells if cell.cell_type == "code"]
    assert code
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)
    for cell in code:
        compile(cell.source, cell.id, "exec")


@pytest.mark.nightly
def test_it_records_attacks_and_reports(executed: tuple[Path, dict[str, list[Any]]]) -> None:
    folder, outputs = executed
    data_set = folder / "datasets" / "smoke"
    (made,) = data_set.glob("detach-best-0.01*")
    clean, detached = open_bag(data_set), open_bag(made)
    assert len(list(clean.frames())) == 10
    before, after = clean.frame(5), detached.frame(1)
    assert before.stamp_ns == after.stamp_ns
    assert len(before.cloud) - len(after.cloud) == (len(before.cloud) + 50) // 100  # halves round up
    assert "10 frames, 10 clouds" in html(outputs["simulate"])
    assert "2 frames, 2 attacked" in html(outputs["attack"])


@pytest.mark.nightly
def test_it_shows_the_clouds(executed: tuple[Path, dict[str, list[Any]]]) -> None:
    _, outputs = executed
    (picture,) = [output for output in outputs["birds-eye"] if "image/png" in output.get("data", {})]
    assert len(picture.data["image/png"]) > 20_000


@pytest.mark.nightly
def test_it_shows_the_figures_of_the_report(executed: tuple[Path, dict[str, list[Any]]]) -> None:
    folder, outputs = executed
    report = json.loads((folder / "datasets/smoke/reports/small/report.json").read_text())
    (row,) = report["rows"]
    assert row["map_adv"] < 0.5 * row["map_clean"]
    assert f"<td>{row['map_ratio_percent']:.2f}</td>" in html(outputs["evaluate"])
    shown = re.findall(r"<td>([0-9.]+)</td>", html(outputs["data-frame"]))
    assert any(float(value) == pytest.approx(row["map_ratio_percent"], abs=1e-6) for value in shown)
    (line,) = (each for each in outputs["lies"] if each.get("name") != "stderr")  # which has the progress
    false_cams, cams = (int(part) for part in line.text.split() if part.isdigit() and part != "0")
    assert 0 < false_cams < cams == len(open_bag(folder / "datasets/smoke").sent_cams())
