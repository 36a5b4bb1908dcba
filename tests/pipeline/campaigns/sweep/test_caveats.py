"""What stands beside a sweep's tables; and that the committed reports say it too."""

import json
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from cells import cell

from advpipe.pipeline.campaigns.sweep import ingredients
from advpipe.pipeline.campaigns.sweep.caveats import NOT_SURE, sweep_caveats
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.results.deprecated import new_key
from advpipe.stages.evaluate.report.report import FORMULAS
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, OLDER_BASELINES

REPORTS = Path(__file__).parents[4] / "datasets" / "reports"


MEASURED_SHA256 = json.loads(ingredients.PATH.read_text())["detach"]["detector_sha256"]


def paper(weight, rms_m=0.0022262942):
    made = cell("perturb-10", 99.5, recipe="paper")
    parameters = {"eps_cm": 10.0, "weight": weight}
    attack = replace(made.row.attack, parameters=parameters)
    attacked = replace(made.row.attacked, rms_displacement_m=rms_m)
    return replace(made, row=replace(made.row, attack=attack, attacked=attacked))


def test_recipe_paper_is_said_to_hold_its_points():
    (stated,) = [text for text in sweep_caveats([paper(0.01)]) if text.startswith("paper-perturb-10:")]
    assert "λ = 0.01" in stated
    assert "to 2.2 mm (RMS) of the 100 mm allowed" in stated
    for other in (paper(0.0, 0.0867), cell("perturb-10", 40.0)):
        assert not [text for text in sweep_caveats([other]) if "λ" in text]


def test_the_measured_robust_is_said_to_be_the_earlier_one():
    made = cell("detach-1", 50.0, recipe="robust")
    assert NOT_SURE not in sweep_caveats([made])  # of a detector that was not measured
    measured = replace(made, settings=replace(made.settings, detector_sha256=MEASURED_SHA256))
    assert NOT_SURE in sweep_caveats([measured])


def test_random_best_is_named_and_where_it_was_measured_so_are_its_figures():
    made = cell("detach-1", 50.0)
    older = cell("detach-1", 50.0, name="baseline_full_best")
    for cells, stated in (
        ([made], [ABOUT_BASELINES]),
        ([older], [OLDER_BASELINES]),
        ([made, older], [ABOUT_BASELINES, OLDER_BASELINES]),
        ([cell("detach-1", 50.0, random=None)], []),
    ):
        caveats = sweep_caveats(cells)
        assert [text for text in caveats if text in (ABOUT_BASELINES, OLDER_BASELINES)] == stated
    measured = replace(made, settings=replace(made.settings, detector_sha256=MEASURED_SHA256))
    (figures,) = [text for text in sweep_caveats([measured]) if "recipe random-best leaves" in text]
    for pair in ("76.6 % against 34.4 %", "53.7 % against 28.6 %", "66.3 % against 11.1 %"):
        assert pair in figures
    assert not [text for text in sweep_caveats([made]) if "recipe random-best leaves" in text]


def test_lost_has_an_overlap_and_its_scores():
    cells = [cell("detach-1", 50.0), cell("perturb-10", 40.0)]
    row = cells[1].row
    cells[1] = replace(cells[1], row=replace(row, counts=replace(row.counts, working_score=0.3)))
    (stated,) = [text for text in sweep_caveats(cells) if text.startswith("Lost objects")]
    assert "at loose overlap, with a score of at least 0.25 or 0.30" in stated


def test_the_committed_report_says_what_its_columns_are():
    report = json.loads((REPORTS / "town06" / "report.json").read_text())
    assert {key: FORMULAS[key] for key in report["formulas"] if not new_key(key)} == {
        key: text for key, text in report["formulas"].items() if not new_key(key)
    }
    cells = Store(REPORTS / "town06").cells()
    assert report["caveats"] == sweep_caveats(cells)
    assert len([each for each in report["cells"] if each["status"] == "done"]) == len(cells)
    assert report["warnings"] == []  # Town06 is no training map


def test_the_committed_older_report_says_what_its_columns_are():
    report = json.loads((REPORTS / "town06-budgets" / "report.json").read_text())
    formulas = {key: text for key, text in report["formulas"].items() if not new_key(key)}
    made_before_random_best = ("baseline", "significant_vs_random", "white_box")
    for key, text in formulas.items():
        assert key in made_before_random_best or FORMULAS[key] == text
    assert {"baseline", "significant_vs_random", "lost", "white_box"} <= set(report["formulas"])
    assert [
        text for text in report["caveats"] if text.startswith("The random baselines here are the plain ones")
    ]
    assert [text for text in report["caveats"] if text.startswith("The attacker knows more")]
    rows = [each["row"] for each in report["cells"] if each["status"] == "done"]
    (lost,) = [text for text in report["caveats"] if text.startswith("Lost objects")]
    assert all(f"{row['working_score']:.2f}" in lost for row in rows)
    held = [text for text in report["caveats"] if text.startswith("paper-perturb-10: ")]
    assert len(held) == sum(row["recipe"] == "paper" and row["attack"] == "perturb" for row in rows)
    assert report["warnings"] == []  # Town06 is no training map
