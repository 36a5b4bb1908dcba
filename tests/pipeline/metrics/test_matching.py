"""Joined matches and parts of them, by hand; the matching itself is tested with the average precision."""

import numpy as np
import pytest

from advpipe.pipeline.metrics.average_precision import RankedMatches, average_precision
from advpipe.pipeline.metrics.matching import FrameMatches, MatchTable, match_frame, match_overlaps


def cars(*xs: float) -> np.ndarray:
    return np.array([[x, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0] for x in xs]).reshape(-1, 7)


def match(truth, detections, scores, evaluated=None) -> FrameMatches:
    evaluated = np.ones(len(truth), bool) if evaluated is None else np.array(evaluated, bool)
    return match_frame(truth, evaluated, detections, np.array(scores, float), 0.7)


def test_finds_is_the_inverse_of_found_by():
    frame = match(cars(0, 10, 20), cars(50, 20, 0), [0.9, 0.8, 0.7])
    assert frame.found_by.tolist() == [2, -1, 1]
    assert frame.finds.tolist() == [-1, 2, 0]


def test_a_matrix_of_overlaps_is_matched():
    overlap = np.array([[0.8, 0.75], [0.9, 0.1]])
    frame = match_overlaps(overlap, np.array([True, True]), np.array([0.6, 0.7]), 0.7)
    # the second scores higher and takes the first object; the first is left the other one
    assert frame.finds.tolist() == [1, 0]


def test_a_table_numbers_detections_over_all_frames():
    frames = [
        match(cars(0), cars(0, 50), [0.9, 0.8]),
        match(cars(), cars(), []),
        match(cars(0, 10), cars(10), [0.7]),
    ]
    table = MatchTable.of(frames)
    assert table.detection_frame.tolist() == [0, 0, 2]
    assert table.truth_frame.tolist() == [0, 2, 2]
    assert table.matches.found_by.tolist() == [0, -1, 2]
    assert table.n_frames == 3
    assert RankedMatches.of(table).n_truth.tolist() == [1, 0, 2]
    assert RankedMatches.of(table).average_precision() == average_precision(frames)


def test_a_table_may_have_no_frames():
    assert np.isnan(RankedMatches.of(MatchTable.of([])).average_precision())


def near(xs, limit=15.0):
    return np.abs(np.array(xs)) < limit


def test_objects_outside_a_selection_and_their_detections_are_not_counted():
    # near: the car at 0, found, and at 10, missed; far: one at 20, found with the best score
    table = MatchTable.of([match(cars(0, 10, 20), cars(20, 0), [0.9, 0.8])])
    part = table.within(near([0, 10, 20]), near([20, 0]))
    assert part.matches.is_evaluated.tolist() == [True, True, False]
    assert part.matches.is_ignored.tolist() == [True, False]
    assert RankedMatches.of(part).average_precision() == 20 / 40
    rest = table.within(~near([0, 10, 20]), ~near([20, 0]))
    assert RankedMatches.of(rest).average_precision() == 1.0


def test_a_false_positive_counts_only_in_its_own_selection():
    # the false positive at 30 scores best: it halves the precision of the far part and not of the near one
    table = MatchTable.of([match(cars(0, 20), cars(30, 0, 20), [0.9, 0.8, 0.7])])
    at = [30, 0, 20]
    assert RankedMatches.of(table.within(near([0, 20]), near(at))).average_precision() == 1.0
    assert RankedMatches.of(table.within(~near([0, 20]), ~near(at))).average_precision() == 0.5


def test_a_detection_just_outside_that_matches_an_object_inside_counts():
    table = MatchTable.of([match(cars(14.9), cars(15.1), [0.9])])
    part = table.within(near([14.9]), near([15.1]))
    assert part.matches.is_true_positive.tolist() == [True]
    assert RankedMatches.of(part).average_precision() == 1.0


def test_ignored_detections_stay_ignored():
    table = MatchTable.of([match(cars(0, 10), cars(0, 10), [0.9, 0.8], evaluated=[False, True])])
    part = table.within(np.array([True, True]), np.array([True, True]))
    assert part.matches.is_ignored.tolist() == [True, False]
    assert part.matches.is_evaluated.tolist() == [False, True]


@pytest.mark.parametrize("seed", range(3))
def test_selections_partition_objects_and_detections(seed):
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(5):
        truth = cars(*rng.uniform(-40, 40, 6))
        found = truth[rng.random(6) < 0.7] + rng.normal(0, 0.1, 7)
        detections = np.concatenate([found, cars(*rng.uniform(-40, 40, 3))])
        frames.append(match(truth, detections, rng.random(len(detections)), rng.random(6) < 0.8))
    table = MatchTable.of(frames)
    truths = rng.integers(0, 3, len(table.truth_frame))
    detections = rng.integers(0, 3, len(table.detection_frame))
    parts = [table.within(truths == part, detections == part).matches for part in range(3)]
    whole = table.matches
    assert (sum(p.is_evaluated.astype(int) for p in parts) == whole.is_evaluated).all()
    assert (sum(p.is_true_positive.astype(int) for p in parts) == whole.is_true_positive).all()
    assert (sum((~p.is_ignored).astype(int) for p in parts) == ~whole.is_ignored).all()


def test_a_detection_may_be_ignored_unless_it_finds_an_evaluated_object():
    frame = match(cars(0), cars(0, 50, 60), [0.9, 0.8, 0.7])
    ignored = frame.ignoring(np.array([True, True, False]))
    assert ignored.is_true_positive.tolist() == [True, False, False]
    assert ignored.is_ignored.tolist() == [False, True, False]
    assert ignored.is_false_positive().tolist() == [False, False, True]
