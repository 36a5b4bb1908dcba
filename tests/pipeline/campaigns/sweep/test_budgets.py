"""The paper's figures, checked against sums made by hand of its Table II, and between its two tables."""

import pytest

from advpipe.pipeline.campaigns.sweep.budgets import TABLE_ONE, TABLES, budget_named, choose_budgets
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import attack_spec

SUMS = {"perturb": (536.96, 0.03058), "detach": (569.83, 0.23670), "attach": (514.52, 0.00851)}


@pytest.mark.parametrize("attack", SUMS)
def test_columns_add_up(attack):
    mine = [budget for budget in TABLES["paper"] if budget.attack == attack]
    assert len(mine) == 6
    assert sum(budget.paper_map_ratio_percent for budget in mine) == pytest.approx(SUMS[attack][0])
    assert sum(budget.paper_chamfer_distance_m2 for budget in mine) == pytest.approx(SUMS[attack][1])
    assert [budget.printed for budget in mine] == sorted(budget.printed for budget in mine)


def test_table_one_repeats_figures_of_table_two():
    found = [budget_named(name) for name in TABLE_ONE]
    assert [budget.paper_map_ratio_percent for budget in found] == [73.20, 91.77, 78.46]
    assert [budget.paper_chamfer_distance_m2 for budget in found] == [0.01533, 0.07035, 0.00126]


def test_parameters_are_those_of_the_attacks():
    assert budget_named("perturb-0.5").parameters == {"eps_cm": 0.5}
    assert budget_named("detach-0.05").parameters == {"ratio": 0.0005}
    assert budget_named("detach-1.5").parameters == {"ratio": 0.015}
    assert budget_named("attach-0.7").parameters == {"eps_m": 0.7, "points": 300}
    for budget in TABLES["paper"]:
        attack_spec({"type": budget.attack, "parameters": budget.parameters})


def test_some_are_chosen_in_the_order_of_the_table():
    chosen = choose_budgets("paper", ["attach-1", "perturb-1"])
    assert [budget.name for budget in chosen] == ["perturb-1", "attach-1"]
    assert len(choose_budgets("paper")) == 18
    with pytest.raises(AdvpipeError, match=r"unknown cell 'perturb-2'; .* known: perturb-0\.5, perturb-1, "):
        choose_budgets("paper", ["perturb-2"])
