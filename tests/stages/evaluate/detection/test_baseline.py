"""Random baselines spend the attack's budget exactly; of several draws each object keeps the best one."""

import numpy as np
import pytest

from advpipe.pipeline.baselines import points_near_boxes
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyz
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.stages.evaluate.detection.baseline import baseline_title, random_baselines
from advpipe.stages.evaluate.detection.random_change import RandomChange, SpentBudget, regions

BOXES = np.array([[-10.0, 0.0, 0.0, 6.0, 6.0, 10.0, 0.0], [10.0, 5.0, 0.0, 6.0, 6.0, 10.0, 0.5]])


def cloud(n: int = 400) -> np.ndarray:
    rng = np.random.default_rng(0)
    points = np.zeros(n, POINT_DTYPE)
    points["x"], points["y"], points["z"] = rng.uniform(-20, 20, (n, 3)).T * [[1], [1], [0.2]]
    points["time"] = np.arange(n) * 1e-4
    return points


def removed(count: int) -> np.ndarray:
    return cloud()[count:]


def moved() -> np.ndarray:
    after = cloud()
    after["x"][:5] += np.array([0.1, 0.2, 0.3, 0.4, 0.5], np.float32)
    return after


def added() -> np.ndarray:
    new = cloud()[:7].copy()
    new["z"] += 0.5
    return np.concatenate([cloud(), new])


def no_worth(points: np.ndarray) -> np.ndarray:
    return np.zeros(len(BOXES))


def clouds_of(
    after: np.ndarray, seed: int = 0, n_draws: int = 1, worth=no_worth, parameters=None, boxes=BOXES
):
    change = cloud_difference(cloud(), after)
    budget = SpentBudget.of(cloud(), after, change, parameters or {})
    return dict(random_baselines(cloud(), boxes, budget, worth, n_draws=n_draws, seed=seed, index=3))


@pytest.mark.parametrize("n_draws", [1, 4])
def test_removes_as_many_elsewhere(n_draws):
    clouds = clouds_of(removed(10), n_draws=n_draws)
    assert list(clouds) == (
        ["baseline", "baseline_near"]
        if n_draws == 1
        else ["baseline", "baseline_best", "baseline_near", "baseline_near_best"]
    )
    for random in clouds.values():
        change = cloud_difference(cloud(), random)
        assert len(change.removed) == 10
        assert len(change.added) == 0
        assert change.removed.tolist() != list(range(10))


def test_near_objects_first_then_anywhere():
    near = points_near_boxes(cloud(), BOXES)
    assert 10 < near.sum() < 100
    few = cloud_difference(cloud(), clouds_of(removed(8))["baseline_near"]).removed
    assert near[few].all()
    many = cloud_difference(cloud(), clouds_of(removed(200))["baseline_near"]).removed
    assert len(many) == 200
    assert set(np.flatnonzero(near)) < set(many)


@pytest.mark.parametrize("baseline", ["baseline", "baseline_near", "baseline_best", "baseline_near_best"])
def test_moves_as_many_as_far(baseline):
    change = cloud_difference(cloud(), moved())
    random = cloud_difference(cloud(), clouds_of(moved(), n_draws=3)[baseline])
    assert len(random.moved) == 5
    assert sorted(random.displacement_m) == pytest.approx(sorted(change.displacement_m), abs=1e-5)
    assert (np.sort(random.displacement_m) <= np.sort(change.displacement_m)).all()
    assert random.moved.tolist() != change.moved.tolist()


def test_every_point_by_the_bound():
    random = cloud_difference(cloud(), clouds_of(moved(), parameters={"eps_cm": 70})["baseline_full"])
    assert len(random.moved) == 400
    assert (random.displacement_m <= 0.7).all()
    assert random.displacement_m == pytest.approx(0.7, abs=1e-5)
    unstated = cloud_difference(cloud(), clouds_of(moved())["baseline_full"])
    assert unstated.max_displacement_m == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize(("parameters", "reach_m"), [({}, 0.5), ({"eps_m": 2.0}, 2.0)])
@pytest.mark.parametrize("baseline", ["baseline", "baseline_near", "baseline_near_best"])
def test_adds_as_many_no_farther(baseline, parameters, reach_m):
    random = clouds_of(added(), n_draws=2, parameters=parameters)[baseline]
    change = cloud_difference(cloud(), random)
    assert len(change.added) == 7
    assert len(change.removed) == 0
    new = xyz(random[change.added])
    distance_m = np.linalg.norm(new[:, None] - xyz(cloud())[None], axis=2).min(axis=1)
    assert (distance_m <= reach_m + 1e-5).all()
    assert distance_m.max() > 0.05
    if "near" in baseline:
        inside = points_in_boxes(new, BOXES, 0.5 + reach_m)
        assert len(set(np.concatenate(inside))) == 7


def test_untouched_frame_and_frame_without_objects():
    for random in clouds_of(cloud(), n_draws=3).values():
        assert (random == cloud()).all()
    for random in clouds_of(removed(10), n_draws=3, worth=lambda c: np.zeros(0), boxes=BOXES[:0]).values():
        assert len(random) == 390


def test_points_without_coordinates_are_no_points_to_take():
    change = SpentBudget(300, 0, np.zeros(0), 0.0, 0.0)
    points = cloud()
    points["x"][100:] = np.nan
    random = RandomChange(points, BOXES, change, np.ones(400, bool), np.random.default_rng(0))
    kept = random.apply(random.draw())
    assert len(kept) == 300  # all 100 that there are
    assert np.isnan(kept["x"]).all()


def test_each_object_keeps_its_best_try():
    """The worth of an object is the number of its points left: the best draw has the minimum of each."""
    region = regions(xyz(cloud()), BOXES)
    counts = []

    def worth(points):
        left = regions(xyz(points), BOXES)
        counts.append([(left == 0).sum(), (left == 1).sum()])
        return np.array(counts[-1], float)

    best = clouds_of(removed(150), n_draws=6, worth=worth)["baseline_best"]
    tried, together = np.array(counts[:6]), counts[6]
    assert together == tried.min(axis=0).tolist()
    assert len(best) == 250
    # The draws share out the budget alike: only which points of a region go is drawn anew.
    assert len(set(map(tuple, tried))) == 1
    assert tried[0].tolist() == [(region == k).sum() - _removed_in(best, region, k) for k in (0, 1)]


def _removed_in(after, region, k):
    gone = cloud_difference(cloud(), after).removed
    return int((region[gone] == k).sum())


def test_best_try_is_taken_region_by_region():
    """Object 0 is worth the mean x of its points, object 1 its mean y: each try is best somewhere."""
    region = regions(xyz(cloud()), BOXES)
    tried = []

    def worth(points):
        left = regions(xyz(points), BOXES)
        tried.append((points["x"][left == 0].mean() + 100, points["y"][left == 1].mean() + 100))
        return np.array(tried[-1], float)

    clouds = clouds_of(removed(150), n_draws=6, worth=worth)
    best = worth(clouds["baseline_best"])
    assert best == pytest.approx(np.array(tried[:6]).min(axis=0))
    assert best[0] < tried[0][0] or best[1] < tried[0][1]
    assert (region >= 0).sum() > 20


def test_a_single_try_that_hides_more_as_a_whole_is_taken():
    worths = iter([[5, 0], [0, 5], [9, 9], [5, 0], [0, 5], [9, 9]])
    clouds = clouds_of(removed(40), n_draws=2, worth=lambda points: np.array(next(worths), float))
    first = clouds_of(removed(40))["baseline"]
    assert (clouds["baseline_best"] == first).all()


def test_same_seed_same_cloud():
    for baseline, random in clouds_of(removed(10), n_draws=2).items():
        assert (random == clouds_of(removed(10), n_draws=2)[baseline]).all()
        assert (random != clouds_of(removed(10), seed=1, n_draws=2)[baseline]).any()


def test_more_tries_leave_the_first_as_it_is():
    assert (clouds_of(moved())["baseline"] == clouds_of(moved(), n_draws=5)["baseline"]).all()


def test_titles():
    assert baseline_title("baseline") == "randomly anywhere"
    assert baseline_title("baseline_near_best") == "randomly near objects, best try"


def test_as_many_intensities_as_the_attack_changed():
    clean = cloud()
    clean["intensity"] = np.random.default_rng(1).uniform(10, 20, len(clean))
    after = clean.copy()
    after["intensity"][:9] = 20.0
    change = cloud_difference(clean, after)
    assert change.intensity_changed.tolist() == list(range(9))
    assert len(change.moved) == 0
    budget = SpentBudget.of(clean, after, change, {})
    clouds = dict(random_baselines(clean, BOXES, budget, no_worth, n_draws=2, seed=0, index=3))
    near = points_near_boxes(clean, BOXES)
    for baseline, random in clouds.items():
        drawn = cloud_difference(clean, random)
        assert len(drawn.intensity_changed) == (len(clean) if "full" in baseline else 9)
        assert not len(drawn.moved)
        assert not len(drawn.removed)
        assert random["intensity"].min() >= clean["intensity"].min()
        assert random["intensity"].max() <= clean["intensity"].max()
        assert near[drawn.intensity_changed].all() == ("near" in baseline)
    assert len(np.unique(clouds["baseline_full"]["intensity"])) > 300
