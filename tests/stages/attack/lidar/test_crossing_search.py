"""The search over crossings: an object that makes no progress goes on from its best points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from cloud_moves import rng

from advpipe.pipeline.adversary.constraints import Constraints, Rules
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import goal_of, owners
from advpipe.pipeline.messages.cloud import xyz, xyzi
from advpipe.stages.attack.lidar.crossing_search import CrossingSearch, CrossingSettings

ROUNDS = 6


def search_of(scene, settings):
    cloud, boxes, detector = scene
    points = xyzi(cloud)
    goal = goal_of(Constraints(), detector, cloud, boxes)
    owner, focus = owners(points[:, :3], goal.regions, settings.margin_m), Focus(points, goal.regions)
    rules = Rules(Constraints(), xyz(cloud), boxes)
    return CrossingSearch(points, goal, detector, rules, owner, focus, 0.5, settings, rng())


def is_home(search):
    return bool((search.choice == search.options.home).all())


def test_without_patience_a_search_goes_on_from_where_it_is(scene):
    search = search_of(scene, CrossingSettings())
    homes = []
    for _ in search.candidates(ROUNDS):
        search.accept(np.zeros(len(search.points), bool))
        homes.append(is_home(search))
    assert homes == [True] + [False] * ROUNDS


def test_after_its_patience_an_object_goes_on_from_its_best_points(scene):
    search = search_of(scene, replace(CrossingSettings(), patience=2))
    homes = []
    for _ in search.candidates(ROUNDS):
        search.accept(np.zeros(len(search.points), bool))
        homes.append(is_home(search))
    assert homes == [True, True, False, True, False, True, False]


def test_progress_renews_the_patience(scene):
    search = search_of(scene, replace(CrossingSettings(), patience=2))
    for number, _ in enumerate(search.candidates(ROUNDS)):
        search.accept(np.full(len(search.points), number > 0))
        if number > 1:
            assert not is_home(search)
            np.testing.assert_array_equal(search.choice, search.kept)
