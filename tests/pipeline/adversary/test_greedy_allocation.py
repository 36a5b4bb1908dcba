from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from advpipe.pipeline.adversary import greedy_allocation as greedy_allocation_module
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.greedy_allocation import allocate, greedy_allocation, queries


@pytest.mark.parametrize("seed", range(20))
def test_allocation_is_the_best_there_is(seed):
    draw = np.random.default_rng(seed)
    costs = [[0, *np.cumsum(draw.integers(1, 5, draw.integers(0, 4))).tolist()] for _ in range(5)]
    values = [np.round(draw.uniform(0, 1, len(cost)), 2).tolist() for cost in costs]
    budget = int(draw.integers(0, 25))

    def total(levels):
        return sum(value[r] - value[0] for value, r in zip(values, levels, strict=True))

    def price(levels):
        return sum(cost[r] for cost, r in zip(costs, levels, strict=True))

    every = product(*[range(len(cost)) for cost in costs])
    best = max(total(levels) for levels in every if price(levels) <= budget)
    levels = allocate(costs, values, budget)
    assert price(levels) <= budget
    assert total(levels) == pytest.approx(best)


class Wall:
    """Objects that fall when they have lost a number of their items, first to last."""

    def __init__(self, needs, helper=False, items=10):
        self.needs, self.helper, self.items, self.asked = np.array(needs), helper, items, 0
        self.looks = []
        self.focus = Focus(np.zeros((1, 4), np.float32), np.zeros((len(needs), 7)))

    @property
    def max_items(self):
        return np.full(len(self.needs), self.items)

    @property
    def clean_values(self):
        return np.zeros(len(self.needs))

    def look(self, taken, *, will_propose):
        """Nothing is known of what the focus has closed."""
        self.looks.append(np.bincount(taken // self.items, minlength=len(self.needs)).tolist())
        return np.where(self.focus.is_open, self.evaluate(taken), np.nan)

    def propose(self, taken, wanted, room):
        self.asked += 1
        have = np.bincount(taken // self.items, minlength=len(self.needs))
        return [
            self.items * m + have[m] + np.arange(min(count, self.items - have[m]))
            for m, count in enumerate(wanted)
        ]

    def evaluate(self, taken):
        have = np.bincount(np.asarray(taken, int) // self.items, minlength=len(self.needs))
        if self.helper and have[1]:  # object 0 falls one item sooner while object 1 has lost one
            have[0] += 1
        return np.where(have >= self.needs, 1.0, 0.1 * have / self.needs)

    def is_satisfied(self, values):
        return values >= 1


def test_greedy_allocation_takes_the_objects_that_fall_to_the_fewest_items():
    chosen, reserve = greedy_allocation(Wall([9, 2, 1, 3]), 7, queries(10))
    of = np.bincount(chosen // 10, minlength=4).tolist()
    assert of == [1, 2, 1, 3]  # one is left over, and scratches object 0
    assert not set(chosen.tolist()) & set(reserve.tolist())
    assert len(greedy_allocation(Wall([9, 2, 1, 3]), 2, queries(10))[0]) <= 2


def test_a_choice_that_leant_on_a_neighbour_is_priced_anew():
    # Object 0 fell with four items as object 1 had lost some; alone it takes five. Object 1 never falls.
    problem = Wall([5, 99], helper=True)
    chosen, _ = greedy_allocation(problem, 5, queries(10))
    assert problem.evaluate(chosen)[0] == 1.0
    assert len(chosen) <= 5


def test_nothing_found_follows_the_gradient_once():
    problem = Wall([1, 1])
    problem.is_satisfied = lambda values: np.ones(2, bool)
    chosen, reserve = greedy_allocation(problem, 4, queries(10))
    assert problem.asked == 1
    assert len(chosen) + len(reserve) >= 4


def test_a_lost_object_gets_back_what_it_did_not_need():
    """Steps go to 12 and 34 items; half-way, 23 are too few, and half-way again, 28 are enough."""
    problem = Wall([28, 28, 28], items=100)
    chosen, _ = greedy_allocation(problem, 95, queries(4))
    assert [each[0] for each in problem.looks] == [0, 12, 34, 23, 28]
    assert np.bincount(chosen // 100).tolist() == [28, 28, 28]


def test_without_a_line_search_steps_are_whole(monkeypatch):
    monkeypatch.setattr(greedy_allocation_module, "LINE_SEARCH", 0)
    problem = Wall([28, 28, 28], items=100)
    chosen, _ = greedy_allocation(problem, 95, queries(4))
    assert (problem.evaluate(chosen) >= 1).sum() == 2


def test_a_line_search_takes_no_more_looks():
    problem = Wall([2, 30, 99, 7], items=100)
    greedy_allocation(problem, 400, queries(10))
    assert len(problem.looks) <= 11  # the clean cloud and ten rounds


def test_an_object_that_its_first_item_loses_needs_no_search():
    problem = Wall([1, 99], items=100)
    chosen, _ = greedy_allocation(problem, 50, queries(40))
    assert (chosen // 100 == 0).sum() == 1
