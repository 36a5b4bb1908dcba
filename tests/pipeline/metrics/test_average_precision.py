"""Average precision: cases worked by hand, a slow independent implementation, and scikit-learn's curves."""

import numpy as np
import pytest
import shapely

from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.metrics.average_precision import (
    R11,
    R40,
    FrameMatches,
    RankedMatches,
    average_precision,
    match_frame,
    mean_average_precision,
)


def cars(*xs: float) -> np.ndarray:
    """Cars of 4 x 2 x 1.5 m along x: an offset of d m between two gives an IoU of (4 - d) / (4 + d)."""
    return np.array([[x, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0] for x in xs]).reshape(-1, 7)


def match(truth, detections, scores, evaluated=None, min_iou=0.7) -> FrameMatches:
    evaluated = np.ones(len(truth), bool) if evaluated is None else np.array(evaluated, bool)
    return match_frame(truth, evaluated, detections, np.array(scores, float), min_iou)


def test_all_objects_found_gives_one():
    assert average_precision([match(cars(0, 10), cars(0, 10), [0.9, 0.8])]) == 1.0


def test_half_found_reaches_half_of_the_recall_positions():
    assert average_precision([match(cars(0, 10), cars(0), [0.9])]) == 20 / 40


def test_false_positive_on_top_halves_the_precision():
    # best score: nothing there; then the one car: precision 1/2 at recall 1
    assert average_precision([match(cars(0), cars(50, 0), [0.9, 0.8])]) == 0.5


def test_a_false_positive_at_the_bottom_has_no_effect():
    assert average_precision([match(cars(0), cars(0, 50), [0.9, 0.1])]) == 1.0


def test_a_mixed_case_equals_a_value_computed_by_hand():
    # T F T over 4 cars: precision 1 at recall 1/4 (10 positions), 2/3 at 2/4 (10 more), then nothing
    frame = match(cars(0, 10, 20, 30), cars(0, 50, 10), [0.9, 0.8, 0.7])
    assert average_precision([frame]) == pytest.approx((10 * 1 + 10 * 2 / 3) / 40)


def test_interpolation_takes_the_best_precision_to_the_right():
    # F T T over 2 cars: 1/2 at recall 1/2, 2/3 at recall 1; the envelope is 2/3 everywhere
    assert average_precision([match(cars(0, 10), cars(50, 0, 10), [0.9, 0.8, 0.7])]) == pytest.approx(2 / 3)


def test_second_detection_of_a_car_is_a_false_positive():
    frame = match(cars(0, 10), cars(0, 0.1, 10), [0.9, 0.8, 0.7])
    assert frame.is_true_positive.tolist() == [True, False, True]
    assert frame.is_false_positive().tolist() == [False, True, False]
    assert average_precision([frame]) == pytest.approx((20 * 1 + 20 * 2 / 3) / 40)


def test_an_overlap_equal_to_the_threshold_matches():
    # offset 4/7 m: IoU = (4 - 4/7) / (4 + 4/7) = 0.75
    assert match(cars(0), cars(4 / 7), [1.0], min_iou=0.7499).is_true_positive.all()
    assert not match(cars(0), cars(4 / 7), [1.0], min_iou=0.7501).is_true_positive.any()


def test_ignored_objects_and_their_detections_are_not_counted():
    frame = match(cars(0, 10), cars(0, 10), [0.8, 0.9], evaluated=[True, False])
    assert frame.n_truth == 1
    assert frame.is_ignored.tolist() == [False, True]
    assert average_precision([frame]) == 1.0


def test_only_ignored_objects_give_nan():
    assert np.isnan(average_precision([match(cars(0), cars(0), [0.9], evaluated=[False])]))


def test_an_evaluated_object_is_preferred_to_an_ignored_one_with_more_overlap():
    frame = match(cars(0, 0.3), cars(0), [0.9], evaluated=[False, True])
    assert frame.is_true_positive.tolist() == [True]
    assert frame.found_by.tolist() == [-1, 0]


def test_a_second_detection_may_match_an_ignored_object():
    frame = match(cars(0, 0.3), cars(0, 0.1), [0.9, 0.8], evaluated=[True, False])
    assert frame.is_true_positive.tolist() == [True, False]
    assert frame.is_ignored.tolist() == [False, True]


def test_the_best_score_is_matched_first_with_the_highest_overlap():
    frame = match(cars(0, 0.6), cars(0.5, 0.0), [0.9, 0.8])
    assert frame.found_by.tolist() == [1, 0]


def test_equal_scores_within_a_frame_are_matched_in_the_order_given():
    assert match(cars(0), cars(0.2, 0.0), [0.5, 0.5]).found_by.tolist() == [0]


def test_equal_scores_in_several_frames_share_a_threshold():
    hit, miss = match(cars(0), cars(0), [0.5]), match(cars(0), cars(50), [0.5])
    # one threshold: 1 of 2 found with precision 1/2, whichever frame comes first
    assert average_precision([hit, miss]) == average_precision([miss, hit]) == 20 * 0.5 / 40


def test_empty_frames_and_missing_detections_are_counted():
    nothing = match(cars(), cars(), [])
    assert np.isnan(average_precision([nothing]))
    assert np.isnan(average_precision([]))
    assert average_precision([nothing, match(cars(0), cars(), [])]) == 0.0
    assert average_precision([nothing, match(cars(0), cars(0), [0.3])]) == 1.0
    assert average_precision([match(cars(), cars(0), [0.3]), match(cars(0), cars(0), [0.2])]) == 0.5


def r11(frames) -> float:
    return RankedMatches.of(frames).average_precision(positions=R11)


def test_r11_reads_recall_0_too():
    # one of two cars: recall 1/2 reaches 0, 0.1, ... 0.5, that is 6 of 11 positions
    assert r11([match(cars(0, 10), cars(0), [0.9])]) == pytest.approx(6 / 11)
    # F T over one car: precision 1/2 at every position
    assert r11([match(cars(0), cars(50, 0), [0.9, 0.8])]) == 0.5


def test_r11_equals_a_value_computed_by_hand():
    # T F T over 4 cars: 1 at recalls 0, .1, .2 (up to 1/4), 2/3 at .3, .4, .5, nothing beyond
    frame = match(cars(0, 10, 20, 30), cars(0, 50, 10), [0.9, 0.8, 0.7])
    assert r11([frame]) == pytest.approx((3 * 1 + 3 * 2 / 3) / 11)


def test_r11_without_objects_is_nan():
    assert r11([match(cars(0), cars(), [])]) == 0.0
    assert r11([match(cars(0), cars(50), [0.9])]) == 0.0
    assert np.isnan(r11([match(cars(), cars(0), [0.9])]))


def test_a_recall_equal_to_a_position_reaches_it():
    for n in (3, 7, 10, 40, 41, 120):  # i / n == k / 40 must not be missed by rounding
        truth = cars(*(10.0 * i for i in range(n)))
        for found in {1, n // 2, n - 1, n} - {0}:
            frame = match(truth, truth[:found], np.linspace(0.9, 0.5, found))
            assert average_precision([frame]) == (40 * found // n) / 40
            assert r11([frame]) == pytest.approx((10 * found // n + 1) / 11)


def test_birds_eye_overlap_ignores_the_height():
    raised = cars(0)
    raised[0, 2] = 1.0
    truth, scores = cars(0), np.array([0.9])
    assert not match(truth, raised, scores).is_true_positive.any()
    assert match_frame(truth, np.array([True]), raised, scores, 0.7, iou_bev).is_true_positive.all()


def test_found_respects_the_minimum_score():
    frame = match(cars(0, 10, 20), cars(0, 10), [0.9, 0.2], evaluated=[True, True, True])
    assert frame.found().tolist() == [True, True, False]
    assert frame.found(0.5).tolist() == [True, False, False]


def test_the_best_f1_threshold_equals_one_computed_by_hand():
    # F1 at .9: 2*1/(1+2) = .67; at .8: 2*2/(2+2) = 1; at .1: 2*2/(3+2) = .8
    frame = match(cars(0, 10), cars(0, 10, 50), [0.9, 0.8, 0.1])
    assert RankedMatches.of([frame]).best_f1_score() == pytest.approx(0.45)
    assert RankedMatches.of([match(cars(0), cars(0), [0.6])]).best_f1_score() == 0.3
    assert RankedMatches.of([match(cars(0), cars(), [])]).best_f1_score() == 0.0


def test_mean_leaves_out_a_class_without_objects():
    none, half = match(cars(), cars(0), [0.9]), match(cars(0, 10), cars(0), [0.9])
    values = [average_precision([none]), average_precision([half]), 1.0]
    assert mean_average_precision(values) == 0.75
    assert np.isnan(mean_average_precision([]))
    by_draw = mean_average_precision([[np.nan, 1.0], [np.nan, 0.5]])
    assert np.isnan(by_draw[0])
    assert by_draw[1] == 0.75


# --- an independent implementation: shapely overlaps, one threshold at a time, plain loops


def polygon(box):
    x, y, _, length, width, _, yaw = box
    flat = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return shapely.affinity.translate(
        shapely.affinity.rotate(flat, yaw, origin=(0, 0), use_radians=True), x, y
    )


def slow_iou(a, b):
    flat = polygon(a).intersection(polygon(b)).area
    high = max(0.0, min(a[2] + a[5] / 2, b[2] + b[5] / 2) - max(a[2] - a[5] / 2, b[2] - b[5] / 2))
    both = flat * high
    return both / (a[3] * a[4] * a[5] + b[3] * b[4] * b[5] - both)


def slow_counts(frame, threshold, min_iou):
    """True and false positives of a frame among detections of at least a score, matched from scratch."""
    truth, evaluated, detections, scores = frame
    taken, tp, fp = set(), 0, 0
    for k in sorted((k for k in range(len(scores)) if scores[k] >= threshold), key=lambda k: (-scores[k], k)):
        options = [
            (bool(evaluated[m]), slow_iou(detections[k], truth[m]), -m)
            for m in range(len(truth))
            if m not in taken and slow_iou(detections[k], truth[m]) >= min_iou
        ]
        if not options:
            fp += 1
            continue
        is_evaluated, _, minus_m = max(options)
        taken.add(-minus_m)
        tp += is_evaluated
    return tp, fp


def slow_average_precision(frames, min_iou, recalls=tuple(k / 40 for k in range(1, 41))):
    n_truth = sum(int(sum(f[1])) for f in frames)
    points = []
    for threshold in sorted({s for f in frames for s in f[3]}):
        tp, fp = np.sum([slow_counts(f, threshold, min_iou) for f in frames], axis=0)
        points.append((tp / n_truth, tp / (tp + fp) if tp + fp else 0.0))
    total = 0.0
    for wanted in recalls:
        reached = [precision for recall, precision in points if recall >= wanted - 1e-12]
        total += max(reached, default=0.0)
    return total / len(recalls)


def random_frame(rng):
    n = int(rng.integers(0, 7))
    truth = np.column_stack(
        [
            rng.uniform(-15, 15, (n, 2)),
            rng.uniform(-0.2, 0.2, n),
            rng.uniform(3, 5, n),
            rng.uniform(1.5, 2, n),
            rng.uniform(1.4, 1.8, n),
            rng.uniform(-3, 3, n),
        ]
    )
    seen = truth[rng.random(n) < 0.8]
    copies = np.repeat(seen, rng.integers(1, 3, len(seen)), axis=0)
    copies = copies + rng.normal(0, [0.25, 0.1, 0.05, 0.1, 0.05, 0.05, 0.05], copies.shape)
    wrong = rng.uniform([-15, -15, 0, 4, 1.8, 1.5, -3], [15, 15, 0.1, 4.1, 1.9, 1.6, 3], (2, 7))
    detections = np.concatenate([copies, wrong])
    scores = rng.integers(1, 12, len(detections)) / 12  # many ties
    return truth, rng.random(n) < 0.75, detections, scores


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(6))
def test_agrees_with_a_slow_independent_implementation(seed):
    rng = np.random.default_rng(seed)
    frames = [random_frame(rng) for _ in range(8)]
    matches = [match_frame(*f, 0.5) for f in frames]
    assert average_precision(matches) == pytest.approx(slow_average_precision(frames, 0.5), abs=1e-12)
    of_voc = slow_average_precision(frames, 0.5, [k / 10 for k in range(11)])
    assert r11(matches) == pytest.approx(of_voc, abs=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(6))
def test_precision_and_recall_agree_with_scikit_learn(seed):
    metrics = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(100 + seed)
    matches = [match_frame(*random_frame(rng), 0.5) for _ in range(20)]
    ranked = RankedMatches.of(matches)
    precision, recall, _ = metrics.precision_recall_curve(ranked.is_true_positive, ranked.scores)
    # scikit-learn knows of no object that nothing found, and ends with the point (0, 1)
    recall = recall * ranked.is_true_positive.sum() / ranked.n_truth.sum()
    ours_recall, ours_precision = ranked.precision_recall()
    assert ours_recall[::-1] == pytest.approx(recall[:-1])
    assert ours_precision[::-1] == pytest.approx(precision[:-1])
    for positions, recalls in ((R40, np.arange(1, 41) / 40), (R11, np.arange(11) / 10)):
        best = [precision[:-1][recall[:-1] >= r - 1e-12].max(initial=0.0) for r in recalls]
        assert ranked.average_precision(positions=positions) == pytest.approx(np.mean(best))


@pytest.mark.parametrize("positions", [R40, R11])
def test_draws_of_blocks_equal_repeated_frames(positions):
    rng = np.random.default_rng(5)
    matches = [match_frame(*random_frame(rng), 0.5) for _ in range(12)]
    block = np.array([0, 0, 0, 1, 1, 1, 1, 2, 2, 3, 3, 3])
    times = np.concatenate([rng.integers(0, 3, (30, 4)), np.zeros((1, 4), int)])
    drawn = RankedMatches.of(matches).average_precisions(times, block, positions)
    for row, got in zip(times, drawn, strict=True):
        repeated = [m for m, b in zip(matches, block, strict=True) for _ in range(row[b])]
        expected = RankedMatches.of(repeated).average_precision(positions=positions)
        assert got == pytest.approx(expected, nan_ok=True)
    assert np.isnan(drawn[-1])


def test_weights_equal_repeated_frames():
    rng = np.random.default_rng(3)
    matches = [match_frame(*random_frame(rng), 0.5) for _ in range(8)]
    weights = rng.integers(0, 3, 8)
    repeated = [m for m, times in zip(matches, weights, strict=True) for _ in range(times)]
    assert RankedMatches.of(matches).average_precision(weights) == pytest.approx(average_precision(repeated))


def test_draws_of_many_blocks_are_those_of_few_to_the_last_bit(monkeypatch):
    rng = np.random.default_rng(3)
    frames = [random_frame(rng) for _ in range(90)]
    matches = [
        match(truth, found, rng.random(len(scores)), evaluated) for truth, evaluated, found, scores in frames
    ]
    times = rng.multinomial(90, np.full(90, 1 / 90), size=40)
    ranked = RankedMatches.of(matches)
    many = ranked.average_precisions(times, np.arange(90))
    monkeypatch.setattr(f"{RankedMatches.__module__}._FEW_BLOCKS", 90)
    monkeypatch.setattr(f"{RankedMatches.__module__}._CHUNK", 1)
    np.testing.assert_array_equal(ranked.average_precisions(times, np.arange(90)), many)
    assert len(np.unique(many)) > 30


def test_the_order_of_frames_does_not_matter():
    rng = np.random.default_rng(4)
    matches = [match_frame(*random_frame(rng), 0.5) for _ in range(8)]
    assert average_precision(matches) == average_precision(matches[::-1])
