"""Random baselines spend the attack's budget exactly; random-best is the recipe of the attacks."""

import json

import numpy as np
import pytest
import torch
from place_drive import LABELS, PLACES, PlaceDetector

from advpipe.pipeline.adversary.constraints import Constraints
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.baselines import points_near_boxes
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyz
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb
from advpipe.stages.evaluate.detection.baseline import (
    RandomBaselines,
    attack_constraints,
    attack_query_budget,
    baseline_title,
)
from advpipe.stages.evaluate.detection.random_change import SpentBudget, random_change

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


class CountingDetector(PlaceDetector):
    """Counts how often it is asked."""

    def __init__(self):
        self.queries = 0

    def detect(self, cloud):
        self.queries += 1
        return super().detect(cloud)

    def loss(self, points, boxes, labels):
        return torch.zeros(())


def truth(boxes) -> Boxes:
    count = len(boxes)
    return Boxes(boxes, np.zeros(count, np.int64), tuple("ab"[:count]), np.zeros((count, 3)))


def clouds_of(after: np.ndarray, seed: int = 0, tries: int = 3, parameters=None, boxes=BOXES):
    change = cloud_difference(cloud(), after)
    budget = SpentBudget.of(cloud(), after, change, parameters or {})
    random = RandomBaselines(Provenance({}), PlaceDetector(), tries, seed)
    return dict(random.clouds(cloud(), truth(boxes), boxes, budget, 3))


def test_removes_as_many_elsewhere():
    clouds = clouds_of(removed(10), boxes=PLACES[:0])
    assert list(clouds) == ["random_best", "baseline", "baseline_near"]
    for name in ("baseline", "baseline_near"):
        change = cloud_difference(cloud(), clouds[name])
        assert len(change.removed) == 10
        assert len(change.added) == 0
        assert change.removed.tolist() != list(range(10))


@pytest.mark.parametrize("tries", [1, 2, 7])
@pytest.mark.parametrize(
    "attack",
    [
        lambda tries: Detach(ratio=0.1, rounds=tries),
        lambda tries: Attach(eps_m=0.4, points=20, rounds=tries, keep_occlusion_order=True),
        lambda tries: Perturb(eps_cm=30, steps=tries, intensity=True),
    ],
    ids=["detach", "attach", "perturb"],
)
def test_random_best_is_the_recipe(attack, tries):
    """Byte for byte; and it asks the detector no more often than the attack says."""
    made = attack(tries)
    made.recipe = "random-best"
    name = type(made).__name__.lower()
    clean, boxes, parameters = (
        street(),
        Boxes(PLACES, LABELS, (), np.zeros((len(PLACES), 3))),
        {key: value for key, value in vars(made).items() if key in Constraints.__dataclass_fields__},
    )
    parameters |= {key: vars(made)[key] for key in ("eps_cm", "eps_m") if key in vars(made)}
    rng = named_generator(5, "attack", name, "random-best", 3)
    result = made(clean, boxes, CountingDetector(), rng)
    assert len(result.labels) > 15
    budget = SpentBudget.of(clean, result.cloud, cloud_difference(clean, result.cloud), parameters)
    provenance = Provenance({"attack": name, "parameters": json.dumps(parameters)})
    detector = CountingDetector()
    random = RandomBaselines(provenance, detector, made.baseline_tries, 5)
    clouds = dict(random.clouds(clean, boxes, PLACES, budget, 3))
    assert clouds["random_best"].tobytes() == result.cloud.tobytes()
    clean_queries = 3  # the clean cloud as such, for its decoys, and as the first to beat
    assert detector.queries <= made.baseline_tries + clean_queries


def test_bags_of_equal_budgets_share_random_best():
    """The detector is asked again only for another budget, goal, attack, or number of tries."""
    clean, ids = street(), tuple(map(str, range(len(PLACES))))
    boxes = Boxes(PLACES, LABELS, ids, np.zeros((len(PLACES), 3)))
    detector, drawn = CountingDetector(), {}

    def made(removed=10, tries=4, **record):
        about = {key: json.dumps(value) if key == "parameters" else value for key, value in record.items()}
        random = RandomBaselines(Provenance(about), detector, tries, 0, drawn)
        budget = SpentBudget(removed, 0, np.zeros(0), 0.0, 0.0)
        before = detector.queries
        found = dict(random.clouds(clean, boxes, PLACES, budget, 3))["random_best"]
        alone = RandomBaselines(Provenance(about), PlaceDetector(), tries, 0)
        assert found.tobytes() == dict(alone.clouds(clean, boxes, PLACES, budget, 3))["random_best"].tobytes()
        return detector.queries - before

    assert made(recipe="best") > 0
    assert made(recipe="robust") == 0
    for other in (
        {"recipe": "best", "removed": 11},
        {"recipe": "best", "tries": 5},
        {"recipe": "best", "attack": "attach"},
        {"recipe": "hide"},
        {"recipe": "best", "parameters": {"truth": "detections"}},
        {"recipe": "best", "parameters": {"objects": ["0"]}},
        {"recipe": "best", "parameters": {"max_points": 5}},
        {"recipe": "best", "parameters": {"near_objects_m": 0.1}},
        {"recipe": "best", "parameters": {"along_ray": True}},
        {"recipe": "best", "parameters": {"keep_occlusion_order": True}},
        {"recipe": "best", "parameters": {"intensity": [0.1, 0.5]}},  # of a user's own attack
    ):
        assert made(**other) > 0


def test_more_tries_leave_less():
    """What is left of the detections, over seeds: judged tries beat one draw."""
    left = {1: 0.0, 2: 0.0, 13: 0.0}
    clean, boxes = street(), Boxes(PLACES, LABELS, (), np.zeros((len(PLACES), 3)))
    budget = SpentBudget(40, 0, np.zeros(0), 0.0, 0.0)
    for seed in range(5):
        for tries in left:
            random = RandomBaselines(Provenance({}), PlaceDetector(), tries, seed)
            found = dict(random.clouds(clean, boxes, PLACES, budget, 0))["random_best"]
            assert len(found) == len(clean) - 40
            left[tries] += PlaceDetector().detect(found).scores.sum()
    assert left[13] < left[2] < left[1] + 1e-9


def street() -> np.ndarray:
    """Thirty points in each of the places, and some between."""
    draw = np.random.default_rng(4)
    inside = PLACES[:, None, :3] + draw.uniform(-0.4, 0.4, (len(PLACES), 30, 3)) * PLACES[:, None, 3:6]
    between = draw.uniform([1, -20, -1], [50, 20, 1], (100, 3))
    points = np.zeros(30 * len(PLACES) + 100, POINT_DTYPE)
    points["x"], points["y"], points["z"] = np.concatenate([inside.reshape(-1, 3), between]).T
    points["intensity"] = draw.uniform(0, 1, len(points))
    return points


def test_how_many_tries_random_best_has():
    assert attack_query_budget(Provenance({})) == 24
    assert attack_query_budget(Provenance({"looks": "13"})) == 13
    assert attack_query_budget(Provenance({"looks": "1", "baseline_tries": "13"})) == 13
    assert Detach(ratio=0.1, recipe="paper").baseline_tries == Detach(ratio=0.1).query_budget == 13
    assert Perturb(eps_cm=1, recipe="paper").baseline_tries == Perturb(eps_cm=1).query_budget == 24


def test_the_constraints_of_the_attack_bind_its_baseline():
    def of(**parameters):
        return attack_constraints(Provenance({"parameters": json.dumps(parameters)}))

    assert of(eps_cm=5, along_ray=True, max_points=7) == Constraints(along_ray=True, max_points=7)
    assert of(goal="my own goal", along_ray=True) == Constraints()


def test_near_objects_first_then_anywhere():
    near = points_near_boxes(cloud(), BOXES)
    assert 10 < near.sum() < 100
    few = cloud_difference(cloud(), clouds_of(removed(8))["baseline_near"]).removed
    assert near[few].all()
    many = cloud_difference(cloud(), clouds_of(removed(200))["baseline_near"]).removed
    assert len(many) == 200
    assert set(np.flatnonzero(near)) < set(many)


@pytest.mark.parametrize("baseline", ["baseline", "baseline_near"])
def test_moves_as_many_as_far(baseline):
    change = cloud_difference(cloud(), moved())
    random = cloud_difference(cloud(), clouds_of(moved())[baseline])
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
@pytest.mark.parametrize("baseline", ["baseline", "baseline_near"])
def test_adds_as_many_no_farther(baseline, parameters, reach_m):
    random = clouds_of(added(), parameters=parameters)[baseline]
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
    for random in clouds_of(cloud()).values():
        assert (random == cloud()).all()
    lone = clouds_of(removed(10), boxes=BOXES[:0])
    assert {name: len(each) for name, each in lone.items()} == {
        "random_best": 400,  # as the recipe, which has no object to hide
        "baseline": 390,
        "baseline_near": 390,
    }


def test_points_without_coordinates_are_no_points_to_take():
    change = SpentBudget(300, 0, np.zeros(0), 0.0, 0.0)
    points = cloud()
    points["x"][100:] = np.nan
    kept = random_change(points, change, np.ones(400, bool), np.random.default_rng(0))
    assert len(kept) == 300  # all 100 that there are
    assert np.isnan(kept["x"]).all()


def test_same_seed_same_cloud():
    boxes = PLACES[LABELS == 0]
    for baseline, random in clouds_of(removed(10), boxes=boxes).items():
        assert (random == clouds_of(removed(10), boxes=boxes)[baseline]).all()
        assert baseline == "random_best" or (random != clouds_of(removed(10), 1, boxes=boxes)[baseline]).any()


def test_titles():
    assert baseline_title("random_best") == "random-best"
    assert baseline_title("random_best", 13) == "random-best, 13 tries"
    assert baseline_title("random_best", 1) == "random-best, 1 try"
    assert baseline_title("baseline", 13) == "randomly anywhere"
    assert baseline_title("baseline_near_best") == "randomly near objects, best try"  # of older reports


def test_as_many_intensities_as_the_attack_changed():
    clean = cloud()
    clean["intensity"] = np.random.default_rng(1).uniform(10, 20, len(clean))
    after = clean.copy()
    after["intensity"][:9] = 20.0
    change = cloud_difference(clean, after)
    assert change.intensity_changed.tolist() == list(range(9))
    assert len(change.moved) == 0
    budget = SpentBudget.of(clean, after, change, {})
    random = RandomBaselines(Provenance({}), PlaceDetector(), 1, 0)
    clouds = dict(random.clouds(clean, truth(BOXES[:0]), BOXES, budget, 3))
    assert (clouds.pop("random_best") == clean).all()
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
