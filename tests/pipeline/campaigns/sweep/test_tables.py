"""Tables and the choice of a frame, of cells written by hand."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from cells import SETTINGS, cell

from advpipe.pipeline.campaigns.sweep.budgets import TABLES, budget_named
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.compare import cell_differences
from advpipe.pipeline.campaigns.sweep.curves import PAPER, curve_points, draw_convergence
from advpipe.pipeline.campaigns.sweep.loose_tables import hidden_table, loose_table
from advpipe.pipeline.campaigns.sweep.panels import median_frame
from advpipe.pipeline.campaigns.sweep.tables import (
    NOT_RUN,
    baselines_table,
    below_paper,
    budget_table,
    convergence_table,
    recipes_of,
    records,
    seeds_table,
    step,
    table_one,
    table_two,
)
from advpipe.pipeline.campaigns.sweep.variants import (
    seed_above,
    split_recipe,
    variant_parameters,
    with_seed_of,
    with_seeds,
)
from advpipe.pipeline.core.errors import AdvpipeError


def test_a_line_has_the_figures_of_its_cell():
    table = table_two([cell("perturb-10", 40.5)], ["best", "paper"], "perturb")
    assert len(table.lines) == 12
    (line,) = [line for line in table.lines if line[0] == "10 cm, best"]
    figures = ("73.20", "0.01533", "40.50", "39.5…41.5", "70.50", "68.0…73.0", "0.00100", "yes")
    random = ("90.00", "97.00", "-49.50", "-60.0…-40.0", "yes")
    assert line[1:] == (*figures, *random, "0.0999", "0.0123", "~5.00 %", "3")
    assert [line[3] for line in table.lines].count(NOT_RUN) == 11


def test_table_one_says_what_was_not_run():
    table = table_one([cell("detach-1", 50.0)], ["best"])
    paper, ours, random = table.lines
    assert paper[1:] == ("0.01533", "73.20", "–", "0.07035", "91.77", "–", "0.00126", "78.46", "–")
    assert ours == (
        "small, 3 frames, recipe best",
        *[NOT_RUN] * 3,
        "0.00100",
        "50.00 (49.00…51.00)",
        "80.00 (77.50…82.50)",
        *[NOT_RUN] * 3,
    )
    assert random[4:7] == ("0.00200", "90.00", "97.00")


def test_below_the_paper_needs_both_figures():
    budget = budget_named("perturb-10")
    assert below_paper(budget, cell("perturb-10", 73.19, distance=0.01533))
    assert not below_paper(budget, cell("perturb-10", 73.20))
    assert not below_paper(budget, cell("perturb-10", 40.0, distance=0.01534))


def test_records_and_curves_hold_every_budget():
    cells = [cell("attach-0.5", 30.0), cell("attach-0.1", 80.0), cell("attach-1", 20.0, "paper", random=None)]
    assert recipes_of(cells, ["robust"]) == ["robust", "best", "paper"]
    listed = records(cells, ["best"])
    assert [each["cell"] for each in listed] == [budget.name for budget in TABLES["paper"]]
    assert [each["cell"] for each in listed if each["status"] != NOT_RUN] == ["attach-0.1", "attach-0.5"]
    lines = {title: points for (title, _, _), points in curve_points(cells, "attach").items()}
    assert set(lines) == {
        PAPER,
        "ours, recipe best",
        "random baseline beside best",
        "ours, recipe paper",
    }
    assert [(point.x, point.y) for point in lines["ours, recipe best"]] == [
        ((0.1, 0.001), 80.0),
        ((0.5, 0.001), 30.0),
    ]
    assert len(lines[PAPER]) == 6
    assert len(baselines_table(cells).lines) == 2


def test_a_rise_is_one_beyond_the_paired_interval():
    before, after = (
        cell("detach-0.5", 50.0, draws=(48.0, 52.0, None)),
        cell("detach-1", 51.0, draws=(49.0, 53.0, 1.0)),
    )
    points, bounds = step(before, after)
    assert points == 1.0
    assert bounds == (1.0, 1.0)  # each interval is 4 wide: only the pairs show the rise
    assert [line[-1] for line in budget_table([before, after]).lines] == ["yes"]
    assert step(before, cell("detach-1", 51.0)) == (1.0, None)


@pytest.mark.parametrize(
    ("lost", "found", "frame"),
    [
        (((1, 0, 4), (0, 0, 4), (1, 1, 0)), (5, 5, 5), 0),  # totals 2, 1, 8
        (((1, 0, 4), (0, 0, 4), (1, 1, 0)), (0, 5, 5), 2),  # of 1 and 8, the lower
        (((1, 1, 1),), (5, 5, 5), 0),
        (((0, 0, 0),), (0, 0, 0), None),
    ],
)
def test_median_frame(lost, found, frame):
    assert median_frame([cell("detach-1", 50.0, lost=each, found=found) for each in lost]) == frame


def test_a_cell_comes_back_from_its_file(tmp_path):
    made = cell("detach-1", 50.0, draws=(48.0, None))
    again = Cell.from_json(made.to_json(), tmp_path)
    assert again == made
    assert cell_differences(made, again) == []
    assert cell_differences(made, cell("detach-1", 51.0, draws=(48.0, None)))[-1].startswith("row.map_ratio_")


def test_other_numbers_of_steps_are_laid_beside():
    cells = [
        cell("perturb-10", 40.0, draws=(38.0, 42.0)),
        cell("perturb-10", 38.5, recipe="best+twice", draws=(37.0, 41.0)),
        cell("detach-1", 50.0, draws=(48.0, 52.0)),
        cell("detach-1", 45.0, recipe="best+twice", draws=(44.0, 52.5)),
        cell("detach-1", 50.5, recipe="best+half", draws=(47.0, 53.0)),
        cell("attach-0.5", 30.0, draws=(29.0, 31.0)),
        cell("attach-0.5", 20.5, recipe="best+twice", draws=(19.0, 22.0)),
        cell("attach-1", 20.0, recipe="paper+twice"),  # without the plain one there is nothing to say
    ]
    lines = convergence_table(cells).lines
    assert [line[:3] for line in lines] == [
        ("best-perturb-10", "x 1", "40.00"),
        ("best-perturb-10", "x 2", "38.50"),
        ("best-detach-1", "x 0.5", "50.50"),
        ("best-detach-1", "x 1", "50.00"),
        ("best-detach-1", "x 2", "45.00"),
        ("best-attach-0.5", "x 1", "30.00"),
        ("best-attach-0.5", "x 2", "20.50"),
    ]
    assert lines[0][4:] == ("-1.50", "-1.0…-1.0", "yes", "no")
    assert lines[1][4:] == ("–", "–", "–", "–")
    assert (lines[2][4], *lines[2][6:]) == ("-0.50", "yes", "no")
    assert (lines[3][4], *lines[3][6:]) == ("-5.00", "no", "no")
    assert (lines[5][4], *lines[5][6:]) == ("-9.50", "no", "yes")
    lines = [line[0] for line in table_two(cells, ["best", "best+twice"], "detach").lines]
    assert lines[-3:] == ["1 %, best", "1 %, best+twice", "1.5 %, best"]
    listed = records(cells, ["best", "best+twice"])
    assert {each["recipe"] for each in listed if each["status"] == NOT_RUN} == {"best"}
    titles = [title for title, _, _ in curve_points(cells, "perturb")]
    assert not [title for title in titles if "twice" in title or "half" in title]
    (axes,) = draw_convergence(cells).axes
    assert [list(line.get_xdata()) for line in axes.get_lines() if len(line.get_xdata()) == 3] == [
        [0.5, 1, 2]
    ]
    assert draw_convergence(cells[:1]) is None


def test_loose_overlap_is_laid_beside():
    one = cell("perturb-10", 40.0, lost=(1, 2, 0))
    (line,) = loose_table([one]).lines
    assert line == ("best-perturb-10", "40.00", "70.00", "97.00", "-27.00", "–", "3", "9", "0.25")
    drawn = replace(one, other_draws={"loose": [60.0] * 50, "random_best_loose": [80.0, 90.0] * 25})
    assert loose_table([drawn]).lines[0][4:6] == ("-27.00", "-30.0…-20.0")


def test_hide_is_paired_with_best():
    """Where both were drawn together."""
    best = replace(cell("perturb-10", 10.0), other_draws={"loose": [40.0] * 50})
    hide = replace(cell("perturb-10", 5.0, "hide"), other_draws={"loose": [30.0, 32.0] * 25})
    (line,) = hidden_table([best, hide, cell("detach-1", 5.0, "hide")]).lines
    assert line == ("perturb-10", "40.00", "35.00", "-5.00", "-10.0…-8.0")
    other = replace(hide, settings=replace(SETTINGS, seed=4))
    assert hidden_table([best, other]).lines[0][-1] == "–"


def test_unknown_variants_are_named():
    assert split_recipe("best+hide+twice") == ("best", ("hide", "twice"))
    with pytest.raises(
        AdvpipeError,
        match=r"unknown variant 'hlaf' of recipe best; did you mean 'half'\? known: hide, ray, order, ",
    ):
        split_recipe("best+hlaf")
    for recipe in ("best+twice+hide", "best+hide+twice+hide"):
        with pytest.raises(AdvpipeError, match=r"is spelt best\+hide\+twice"):
            split_recipe(recipe)
    with pytest.raises(AdvpipeError, match=r"two numbers of steps; take one of half, twice"):
        split_recipe("best+half+twice")


def test_the_shares_of_the_papers_text_have_lines_where_they_were_run():
    assert [each.printed for each in TABLES["text"]] == [0.1, 0.3, 0.5, 0.7, 1.0, 1.5]
    lines = {line[0]: line for line in table_two([cell("detach-0.7", 60.0)], ["best"], "detach").lines}
    assert list(lines) == [f"{each} %, best" for each in (0.05, 0.1, 0.3, 0.5, 0.7, 1, 1.5)]
    assert lines["0.7 %, best"][1:4] == ("–", "–", "60.00")  # the paper prints no figures for it
    assert below_paper(budget_named("detach-0.7"), cell("detach-0.7", 60.0)) is None
    (record,) = [each for each in records([cell("detach-0.7", 60.0)], ["best"]) if each["status"] != NOT_RUN]
    assert record["paper_map_ratio_percent"] is None
    points = {title: at for (title, _, _), at in curve_points([cell("detach-0.7", 60.0)], "detach").items()}
    assert (len(points[PAPER]), len(points["ours, recipe best"])) == (6, 1)


def test_variants_give_an_attack_what_it_has():
    assert variant_parameters("best+hide+ray", "perturb") == {"goal": "hide", "along_ray": True}
    assert variant_parameters("paper+weighted", "attach") == {"weight": 0.01}
    assert variant_parameters("best+detections+twice", "detach") == {"truth": "detections"}
    assert variant_parameters("best", "detach") == {}
    assert variant_parameters("best+order", "detach") is None  # it only removes points


def test_other_code_is_no_difference_by_itself():
    one = cell("detach-1", 50.0)
    other = replace(one, settings=replace(one.settings, code_sha256="e" * 64), bag_sha256="f" * 64)
    assert cell_differences(one, other) == []
    assert cell_differences(one, replace(one, bag_sha256="f" * 64)) != []
    assert cell_differences(one, replace(other, frames=(0, 2))) == ["frames.2 4, again nothing"]


def test_spread_over_seeds():
    other = replace(cell("detach-1", 20.0, "best+seed1"), settings=replace(SETTINGS, seed=1))
    table = seeds_table([cell("detach-1", 10.0), other, cell("attach-0.5", 3.0)])
    assert table.lines == (
        ("best-detach-1", "0, 1", "15.00", "10.0…20.0", "45.00", "40.0…50.0"),
        ("  random baseline", "0, 1", "90.00", "90.0…90.0", "97.00", "97.0…97.0"),
    )
    assert not seeds_table([cell("detach-1", 10.0), cell("detach-1", 9.0, "best+twice")]).lines


def test_recipes_with_seeds():
    assert with_seeds(["best", "paper+weighted"], 2) == (
        *("best", "best+seed1", "paper+weighted", "paper+weighted+seed1"),
    )
    assert with_seeds(["best+seed3"], 2) == ("best+seed3",)
    assert seed_above("best+twice+seed3") == 3
    assert with_seed_of("best+seed2", replace(SETTINGS, seed=5)).seed == 7
    with pytest.raises(AdvpipeError, match=r"seeds is 11, but a sweep takes at most 10"):
        with_seeds(["best"], 11)
    with pytest.raises(AdvpipeError, match=r"asks for two seeds"):
        split_recipe("best+seed1+seed2")
