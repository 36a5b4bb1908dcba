"""The score-based search for the fewest items that lose each object."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.adversary.adaptive_choice import AdaptiveChoice
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.greedy_allocation import greedy_allocation, queries
from advpipe.pipeline.adversary.item_orders import ORDERS, ordered
from advpipe.pipeline.adversary.subset_search import SubsetSearch

ITEMS = 40


class Bars:
    """Objects of 40 items in a row, which are lost with the last few of them, on the right: `needs` (M,)."""

    def __init__(self, needs, gains=None, found=True):
        self.needs, self.found, self.judged = np.array(needs), found, []
        self.focus = Focus(np.zeros((1, 4), np.float32), np.zeros((len(needs), 7)))
        self.rng = np.random.default_rng(7)
        count = ITEMS * len(needs)
        self.item_owner = np.repeat(np.arange(len(needs)), ITEMS)
        self.item_xyz_m = np.zeros((count, 3))
        self.item_xyz_m[:, 0] = np.tile(np.arange(ITEMS) / 10, len(needs))
        self.is_inside = np.ones(count, bool)
        self.item_gains = np.zeros(count) if gains is None else gains
        self.max_items = np.full(len(needs), ITEMS)
        self.clean_values = np.full(len(needs), 0.0 if found else 1.0)

    def evaluate(self, taken):
        assert len(np.unique(taken)) == len(taken)
        self.judged.append(len(taken))
        place, owner = np.asarray(taken, int) % ITEMS, np.asarray(taken, int) // ITEMS
        right = place >= ITEMS - self.needs[owner]
        have = np.bincount(owner, weights=right, minlength=len(self.needs))
        return np.where(have >= self.needs, 1.0, 0.4 * have / self.needs)

    def look(self, taken, *, will_propose):
        return np.where(self.focus.is_open, self.evaluate(taken), np.nan)

    def propose(self, taken, wanted, room):
        free = [np.setdiff1d(np.flatnonzero(self.item_owner == m), taken) for m in range(len(wanted))]
        return [self.rng.permutation(mine)[:count] for mine, count in zip(free, wanted, strict=True)]

    def is_satisfied(self, values):
        return values >= 1


def lost(problem, taken):
    return int((problem.evaluate(taken) >= 1).sum())


def test_it_loses_more_objects_than_random_ones_at_equal_tries():
    tries, budget = queries(10), 60
    searched, random = 0, 0
    for seed in range(5):
        bars = Bars([6] * 12)
        searched += lost(bars, SubsetSearch(bars, np.random.default_rng(seed)).allocation(budget, tries))
        bars = Bars([6] * 12)
        random += lost(bars, greedy_allocation(bars, budget, tries)[0])
    assert searched >= 2 * random + 5


@pytest.mark.parametrize("tries", [2, 3, 13])
def test_tries_and_budget_are_kept(tries):
    bars = Bars([3, 8, 40])
    taken = SubsetSearch(bars, np.random.default_rng(0)).allocation(25, tries)
    assert len(taken) <= 25
    assert bars.judged[0] == 0  # the clean cloud is no candidate
    assert len(bars.judged) - 1 <= tries


def test_a_good_gradient_is_found_out():
    gains = np.tile(np.arange(ITEMS, dtype=float), 12)
    bars = Bars([6] * 12, gains)
    search = SubsetSearch(bars, np.random.default_rng(0))
    taken = search.allocation(120, 13)
    assert lost(bars, taken) >= 9
    drawn = [search.choice.draw(np.ones(len(ORDERS), bool)) for _ in range(400)]
    by_gradient = [ORDERS[number][0] == "gradient" for number in drawn]
    assert np.mean(by_gradient) > 0.3  # a quarter of the orders


def test_the_rest_goes_by_the_gradient_to_objects_that_are_still_found():
    gains = np.zeros(2 * ITEMS)
    gains[[50, 51, 52]] = 3.0, 2.0, 1.0
    bars = Bars([1, ITEMS], gains)
    bars.evaluate = lambda taken: np.array([1.0 if (np.asarray(taken) < ITEMS).any() else 0.0, 0.0])
    taken = SubsetSearch(bars, np.random.default_rng(0)).allocation(3, 13)
    assert sorted(taken.tolist())[1:] == [50, 51]
    assert taken.min() < ITEMS


def test_where_nothing_is_found_only_the_gradient_tells():
    gains = np.zeros(ITEMS)
    gains[[5, 9]] = 1.0
    bars = Bars([4], gains, found=False)
    assert SubsetSearch(bars, np.random.default_rng(0)).allocation(7, 13).tolist() == [5, 9]


@pytest.mark.parametrize("order", range(len(ORDERS)))
def test_orders_are_permutations_with_the_inside_first_if_asked(order):
    draw = np.random.default_rng(1)
    xyz_m, gains, is_inside = draw.normal(0, 1, (30, 3)), draw.random(30), draw.random(30) < 0.5
    items = draw.permutation(30)[:20]
    found = ordered(items, order, xyz_m, gains, is_inside, draw)
    assert sorted(found.tolist()) == sorted(items.tolist())
    name, inside_first = ORDERS[order]
    if inside_first:
        assert (np.diff(is_inside[found].astype(int)) <= 0).all()
    elif name == "gradient":
        assert (np.diff(gains[found]) <= 0).all()


def test_what_succeeds_is_drawn_more_often_and_what_is_not_allowed_never():
    choice = AdaptiveChoice(3, np.random.default_rng(0))
    for _ in range(20):
        choice.learn(0, is_success=True)
        choice.learn(1, is_success=False)
    every, first_out = np.ones(3, bool), np.array([False, True, True])
    counts = np.bincount([choice.draw(every) for _ in range(300)], minlength=3)
    assert counts[0] > counts[2] > counts[1]
    assert all(choice.draw(first_out) for _ in range(50))
