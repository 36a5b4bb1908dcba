"""`advpipe sweep` from the attack to the tables, on a drive whose answers are clear beforehand."""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.image import imread

sys.path.insert(0, str(Path(__file__).parent))

from sweep_drive import DETECTOR, write_drive

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.campaigns.sweep import settings
from advpipe.pipeline.campaigns.sweep.run import commands_of
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.campaigns.sweep.tables import NOT_RUN
from advpipe.pipeline.cli.sweep import sweep_command
from advpipe.pipeline.core.code import source_commit
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES
from advpipe.stages.evaluate.run import Options, evaluate

# 1 % of 600 points are six, so that one of the car's seven is left; 1.5 % are nine.
DETACH = ["detach-1,detach-1.5"]
TABLE_ONE = ["perturb-10", "detach-1", "attach-0.5"]


def run(clean: Path, out: Path, cells: list[str], **options: object) -> None:
    known = {"detector": DETECTOR, "frames": "::2", "baseline_tries": 1, "workers": 1} | options
    sweep_command(clean, cells=cells, out=out, **known)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "clean")


@pytest.fixture(scope="module")
def swept(clean: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sweep") / "out"
    run(clean, out, DETACH, keep_bags=True)
    return out


def test_one_point_decides(swept: Path) -> None:
    rows = {cell.budget: cell.row for cell in Store(swept).cells()}
    attacked = [figures for name in ("detach-1", "detach-1.5") if (figures := rows[name].attacked)]
    assert [figures.map_ratio_percent for figures in attacked] == [100.0, 0.0]
    fewer = "Fewer tries than the attack's 13: random-best, 1 try."
    assert all(fewer in row.notes for row in rows.values())
    assert [figures.points_removed for figures in attacked] == [6 * 6, 6 * 9]
    (draws,) = {cell.map_ratio_draws for cell in Store(swept).cells() if cell.budget == "detach-1.5"}
    assert set(draws) == {0.0}


def test_rows_are_those_of_the_evaluation(swept: Path, clean: Path, tmp_path: Path) -> None:
    """The bag that was kept, scored by `advpipe evaluate`."""
    bag = resolve_bag(swept / "bags" / "best-detach-1.5")
    report = evaluate(
        clean, [bag], tmp_path / "report", Options(detectors=(DETECTOR,), baseline_tries=1), workers=1
    )
    (row,) = json.loads((tmp_path / "report" / "report.json").read_text())["rows"]
    (cell,) = [cell for cell in Store(swept).cells() if cell.budget == "detach-1.5"]
    stored = json.loads(cell.to_json())
    assert stored["row"].items() <= row.items()
    assert stored["bag_sha256"] == report.origin.compared[0].sha256


def test_tables_hold_the_figures_of_the_cells(swept: Path) -> None:
    report = json.loads((swept / "report.json").read_text())
    assert len(report["cells"]) == 18
    by_name = {each["cell"]: each for each in report["cells"]}
    assert by_name["detach-1.5"]["row"]["map_ratio_percent"] == 0.0
    assert by_name["detach-1.5"]["paper_map_ratio_percent"] == 88.75
    assert by_name["perturb-10"] == {
        "cell": "perturb-10",
        "recipe": "best",
        "attack": "perturb",
        "parameters": {"eps_cm": 10.0},
        "paper_map_ratio_percent": 73.2,
        "paper_chamfer_distance_m2": 0.01533,
        "status": NOT_RUN,
    }
    (about,) = report["provenance"]
    assert about["frame_list"] == [0, 2, 4, 6, 8, 10]
    assert about["commits"] == [commit for commit in [source_commit()] if commit]
    assert set(about["bags_sha256"]) == {"detach-1", "detach-1.5"}
    page = (swept / "report.html").read_text()
    assert page.count(NOT_RUN) == 16 + 2 * 3  # of Table II and, three columns each, of Table I
    assert "<td>1.5 %, best</td><td>88.75</td><td>0.13397</td><td>0.00</td>" in page
    assert 'src="data:image/png;base64,' in page
    assert not any(text in page for text in ('src="http', 'href="', str(swept)))


def test_the_page_begins_with_what_is_known_of_the_map(swept: Path) -> None:
    """The detector names none; and what the columns are stands above them."""
    report = json.loads((swept / "report.json").read_text())
    assert report["warnings"] == [
        f"Training map unknown: {DETECTOR} may have been trained on drives on this map or not: the "
        "detector does not say which maps it was trained on."
    ]
    page = (swept / "report.html").read_text()
    assert page.index('<p class="banner" role="alert">Training map unknown') < page.index("<h1>")
    assert ABOUT_BASELINES in report["caveats"]
    for head in ("random baseline: strict ratio %", "significant", "lost, loose", "score at least"):
        assert f"<th>{head}</th>" in page


def test_what_is_done_is_kept(swept: Path, clean: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = {path.name: path.stat().st_mtime_ns for path in (swept / "figures").iterdir()}
    assert set(figures) == {"perturb.png", "detach.png", "attach.png"}
    files = {path: path.stat().st_mtime_ns for path in (swept / "cells").iterdir()}
    lost = swept / "cells" / "best-detach-1.json"
    before = lost.read_bytes()
    bags = {path: path.stat().st_mtime_ns for path in (swept / "bags").rglob("*")}
    lost.unlink()  # as if killed after the attack, before the figures were there
    run(clean, swept, DETACH, keep_bags=True)
    assert "best-detach-1.5: kept" in capsys.readouterr().out
    changed = [path for path, stamp in files.items() if path.stat().st_mtime_ns != stamp]
    assert changed == [lost]
    assert {path: path.stat().st_mtime_ns for path in (swept / "bags").rglob("*")} == bags
    assert lost.read_bytes() == before
    assert set(json.loads((swept / "times.json").read_text())) == {"best-detach-1", "best-detach-1.5"}


def test_check_computes_again_and_compares(
    swept: Path, clean: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(clean, swept, DETACH, check=2, frames=None)
    out = capsys.readouterr().out
    assert out.splitlines() == ["best-detach-1: the same", "best-detach-1.5: the same"]
    assert not (swept / "check").exists()
    forged = tmp_path / "out" / "cells" / "best-detach-1.json"
    forged.parent.mkdir(parents=True)
    text = (swept / "cells" / forged.name).read_text()
    forged.write_text(text.replace('"points_removed": 36', '"points_removed": 37'))
    with pytest.raises(AdvpipeError, match="best-detach-1 differ from what"):
        run(clean, tmp_path / "out", ["detach-1"], check=1)
    assert "row.points_removed 37, again 36" in capsys.readouterr().out


def test_cells_of_other_code_are_not_mixed_in(
    swept: Path,
    clean: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    shutil.copytree(swept / "cells", out / "cells")
    monkeypatch.setattr(settings, "code_sha256", lambda *parts: "7" * 64)
    with pytest.raises(AdvpipeError, match=r"sweep \(code of advpipe [0-9a-f]{12}…, not 777777777777…"):
        run(clean, out, ["detach-1"])
    run(clean, out, ["detach-1"], check=1)
    assert capsys.readouterr().out == "best-detach-1: the same, though other code of advpipe made it\n"
    run(clean, out, ["detach-1"], overwrite=True)
    assert {cell.settings.code_sha256 for cell in Store(out).cells()} == {"7" * 64}


def test_twice_the_steps_and_as_many_tries(clean: Path, tmp_path: Path) -> None:
    """Ten rounds and three repairs are thirteen looks, twenty and three are 23: baselines get as many."""
    run(clean, tmp_path / "out", ["detach-1"], recipes="best,best+twice", frames="::6", baseline_tries=None)
    rows = {cell.recipe: cell.row for cell in Store(tmp_path / "out").cells()}
    attacks = [rows[name].attack for name in ("best", "best+twice")]
    assert [(each.query_budget, each.baseline_tries) for each in attacks] == [(13, 13), (23, 23)]
    assert not [note for row in rows.values() for note in row.notes if "the best of" in note]
    assert rows["best+twice"].attack.parameters["rounds"] == 20
    page = (tmp_path / "out" / "report.html").read_text()
    assert (
        "<h2>What more steps change; surely under 2 points where the whole interval is, surely more" in page
    )
    assert "<td>best-detach-1</td><td>x 1</td><td>100.00</td><td>100.0…100.0</td><td>0.00</td>" in page
    assert (tmp_path / "out" / "figures" / "convergence.png").is_file()
    (about, twice) = json.loads((tmp_path / "out" / "report.json").read_text())["command"].splitlines()
    assert "--baseline-tries" not in about
    assert "--recipe best+twice " in twice


def test_two_seeds(clean: Path, tmp_path: Path) -> None:
    """The second one is that of a sweep of its own, to the figure; the folder goes on with both."""
    out = tmp_path / "out"
    run(clean, out, ["detach-1"], recipes="random", frames="::6", seed=3, seeds=2)
    cells = {cell.recipe: cell for cell in Store(out).cells()}
    assert {name: cell.settings.seed for name, cell in cells.items()} == {"random": 3, "random+seed1": 4}
    assert cells["random"].bag_sha256 != cells["random+seed1"].bag_sha256
    run(clean, tmp_path / "alone", ["detach-1"], recipes="random", frames="::6", seed=4)
    (alone,) = Store(tmp_path / "alone").cells()
    assert replace(alone.row, bag="") == replace(cells["random+seed1"].row, bag="")
    run(clean, out, ["detach-1"], recipes="random", frames="::6", seed=3, seeds=2)
    run(clean, out, ["detach-1"], recipes="random", frames="::6", seed=3, seeds=2, check=2)
    assert "<h2>Spread over seeds: the same frames, attacked again</h2>" in (out / "report.html").read_text()
    commands = json.loads((out / "report.json").read_text())["command"].splitlines()
    assert [line.partition("--recipe ")[2].split()[0] for line in commands] == ["random", "random+seed1"]
    assert all("--seed 3" in line for line in commands)


def test_recipes_evaluated_together_have_the_figures_of_each_alone(clean: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = {"frames": "::4", "defences": ["flip"], "detect_attacks": ["voxel-face"]}
    recipes = ["best", "hide", "paper", "random-near"]
    run(clean, out, ["detach-1"], recipes=",".join(recipes), **asked)
    together = {cell.recipe: cell for cell in Store(out).cells()}
    assert sorted(together) == recipes
    assert not (out / "bags").exists()
    for recipe, cell in together.items():
        run(clean, tmp_path / recipe, ["detach-1"], recipes=recipe, **asked)
        (alone,) = Store(tmp_path / recipe).cells()
        assert alone == cell


def test_defences_and_attack_checks(swept: Path, clean: Path, tmp_path: Path) -> None:
    """As `advpipe evaluate` has them, on all frames; recipes of a folder may differ in them."""
    out = tmp_path / "out"
    asked = {"defences": ["flip", "quantise:0.01"], "detect_attacks": ["density", "voxel-face"]}
    run(clean, out, ["detach-1.5"], **asked, keep_bags=True)
    (cell,) = Store(out).cells()
    options = Options(
        detectors=(DETECTOR,),
        baseline_tries=1,
        defences=("flip", "quantise:0.01"),
        detect_attacks=("density", "voxel-face"),
    )
    bag = resolve_bag(out / "bags" / "best-detach-1.5")
    evaluate(clean, [bag], tmp_path / "report", options, workers=1)
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert [each["defence"] for each in cell.listed["defences"]] == ["none", "flip", "quantise:step_m=0.01"]
    for key in ("defences", "attack_detection", "attack_success"):
        mine = cell.listed[key]
        assert mine
        assert all(any(record.items() <= theirs.items() for theirs in report[key]) for record in mine)
    page = (out / "report.html").read_text()
    assert "<td>best-detach-1.5</td><td>none</td><td>100.0</td><td>0.00</td>" in page
    assert "<h2>Attack checks: clouds above a threshold that clean ones set</h2>" in page
    command = json.loads((out / "report.json").read_text())["command"]
    texts = "--defence flip --defence quantise:0.01 --detect-attacks density --detect-attacks voxel-face"
    assert command.endswith(texts)
    run(clean, out, ["detach-1.5"], **asked, check=1)
    run(clean, out, ["detach-1.5"], recipes="random")
    assert {cell.recipe: cell.settings.defences for cell in Store(out).cells()} == {
        "best": ("flip", "quantise:0.01"),
        "random": (),
    }
    with pytest.raises(AdvpipeError, match="of another sweep"):
        run(clean, out, ["detach-1"])
    (plain, _) = Store(swept).cells()
    assert not plain.listed["defences"]
    assert "Under defences" not in (swept / "report.html").read_text()


def test_four_panels_of_another_recipe(swept: Path, clean: Path) -> None:
    """Of frames of its own, in the same folder; no bag is left behind."""
    run(clean, swept, TABLE_ONE, recipes="random", frames="::3")
    picture = imread(swept / "figures" / "panels-random.png")
    assert picture.shape[0] > 1000
    assert not (swept / "figures" / "panels-best.png").exists()
    assert sorted(path.name for path in (swept / "bags").iterdir()) == ["best-detach-1", "best-detach-1.5"]
    frames = {cell.recipe: cell.frames for cell in Store(swept).cells()}
    assert frames == {"best": (0, 2, 4, 6, 8, 10), "random": (0, 3, 6, 9)}
    commands = json.loads((swept / "report.json").read_text())["command"].splitlines()
    assert [line.split("--recipe ")[1][:20] for line in commands] == [
        "best --frames 0::2 -",
        "random --frames 0::3",
    ]


def test_the_command_names_the_clouds(swept: Path, clean: Path) -> None:
    (cell, *_) = Store(swept).cells()
    chosen = replace(cell, settings=replace(cell.settings, lidar_topic="/ego/lidar/points"))
    assert commands_of(clean, "paper", [chosen]).endswith("--baseline-tries 1 --lidar /ego/lidar/points")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"cells": ["detach-2"]}, "unknown cell 'detach-2'; did you mean 'detach-1'?"),
        ({"table": "thesis"}, "unknown table 'thesis'; known: paper"),
        ({"recipes": "worst"}, "recipe is 'worst'; known"),
        ({"recipes": "best+thrice"}, "unknown variant 'thrice' of recipe best"),
        ({"recipes": "random-near+twice"}, "recipe random-near does not use rounds"),
        ({"detector": "large"}, "large"),
        ({"defences": ["armour"]}, "unknown defence 'armour'"),
        ({"detect_attacks": ["nose"]}, "unknown attack check 'nose'"),
        ({"frames": "90:"}, "select none of the bag's 12 frames"),
        ({"frames": "::3"}, r"holds best-detach-1 of another sweep \(frames 0::2, not 0::3\)"),
        ({"seed": 4}, r"of another sweep \(seed 0, not 4\)"),
        ({"check": 1, "cells": ["attach-1"]}, "holds none of these cells; run the sweep first"),
    ],
)
def test_mistakes_are_one_line(swept: Path, clean: Path, options: dict[str, object], line: str) -> None:
    before = sorted(os.walk(swept))
    with pytest.raises(AdvpipeError, match=line) as caught:
        run(clean, swept, **({"cells": DETACH} | options))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert sorted(os.walk(swept)) == before


def test_a_damaged_cell_is_named(swept: Path, clean: Path, tmp_path: Path) -> None:
    whole = swept / "cells" / "best-detach-1.json"
    broken = tmp_path / "out" / "cells" / whole.name
    broken.parent.mkdir(parents=True)
    for text in (whole.read_text()[:200], "[]", whole.read_text().replace("detach-1", "detach-9")):
        broken.write_text(text)
        with pytest.raises(AdvpipeError, match=r"best-detach-1\.json is damaged, or no cell of this version"):
            run(clean, tmp_path / "out", ["detach-1"])


def test_a_strange_folder_is_left_alone(clean: Path, tmp_path: Path) -> None:
    (tmp_path / "diary.txt").write_text("dear diary")
    with pytest.raises(AdvpipeError, match=r"holds diary\.txt but no cells/, so it is no sweep"):
        run(clean, tmp_path, DETACH)
    assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]
