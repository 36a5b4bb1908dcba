"""Bodies: those that the scenario knows, drawn in a few sizes and colours."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.scenario.fleet import CAR_SHARES, DEFAULT_MIX
from advpipe.pipeline.scenario.traffic import BODIES as DRIVEN
from advpipe.pipeline.scenario.traffic import PEOPLE, Traffic
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.stages.simulate.bodies import BODIES, LARGEST_M, PAINTS, VARIANTS, draw_variants


def test_the_scenario_lists_exactly_the_bodies_that_drive() -> None:
    assert [name for name, body in BODIES.items() if body.label != "pedestrian"] == list(DRIVEN)
    assert set(Traffic().mix) == set(DRIVEN)
    assert sum(Traffic().mix.values()) == pytest.approx(1.0, abs=1e-3)
    assert len(DRIVEN) >= 24


def test_scenario_body_names_match_the_bodies() -> None:
    assert {*DRIVEN, *PEOPLE} == set(BODIES)
    assert {body.label for body in BODIES.values()} == set(CLASSES)


def test_variants_differ_a_little_and_follow_the_seed() -> None:
    first, again, other = (draw_variants(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert len(first) == VARIANTS * len(BODIES)
    assert first == again
    assert first != other
    for variant in first.values():
        body, size = variant.body, (variant.length_m, variant.width_m, variant.height_m)
        nominal = np.array([body.length_m, body.width_m, body.height_m])
        limit = np.array(body.spread) + [0.01, 0.4 * body.spread[0] + 0.01, 0.01]
        assert np.all(np.abs(size / nominal - 1) <= limit)
        assert np.all(size <= LARGEST_M)


def test_cars_have_the_sizes_of_a_european_fleet() -> None:
    """The mean length of the default mix lies between KITTI's 3.87 m and Argoverse 2's 4.37 m, both within
    the range; longer cars are wider."""
    variants = draw_variants(np.random.default_rng(4))
    cars = [variant for variant in variants.values() if variant.body.label == "car"]
    sizes = np.array([(car.length_m, car.width_m, car.height_m) for car in cars])
    weights = np.array([DEFAULT_MIX[car.body.name] for car in cars])
    weights /= weights.sum()
    length_m, width_m, height_m = weights @ sizes
    assert 4.15 < length_m < 4.35
    assert 1.7 < width_m < 1.82
    assert 1.45 < height_m < 1.58
    assert sizes[:, 0].min() < 3.4
    assert sizes[:, 0].max() > 5.0
    assert weights[sizes[:, 0] < 3.87].sum() > 0.1
    assert np.corrcoef(sizes[:, 0], sizes[:, 1])[0, 1] > 0.7
    assert sum(CAR_SHARES.values()) == pytest.approx(1)


def test_car_in_a_mix_stands_for_the_cars_of_the_fleet() -> None:
    shares = Traffic(mix={"car": 3, "bus": 1, "suv": 1}).shares
    assert sum(shares.values()) == pytest.approx(1)
    assert shares["bus"] == pytest.approx(0.2)
    assert shares["supermini"] == pytest.approx(0.6 * CAR_SHARES["supermini"])
    assert shares["suv"] == pytest.approx(0.2 + 0.6 * CAR_SHARES["suv"])
    assert Traffic(mix={"sedan": 2, "van": 2}).shares == {"sedan": 0.5, "van": 0.5}


def test_colours_have_the_shares_of_registrations() -> None:
    """With strata, few variants come near the shares; half of the cars are dark."""
    assert sum(PAINTS.values()) == pytest.approx(1)
    paints = [
        variant.paint
        for seed in range(5)
        for variant in draw_variants(np.random.default_rng(seed)).values()
        if variant.body.label == "car"
    ]
    for paint, share in PAINTS.items():
        assert paints.count(paint) / len(paints) == pytest.approx(share, abs=0.03)


def test_bodies_have_the_right_station_types() -> None:
    silent = {name for name, body in BODIES.items() if body.station_type is None}
    assert silent == {"bicycle", "cargo_bike", "kick_scooter", *PEOPLE}
    assert all(BODIES[name].station_type == StationType.PASSENGER_CAR for name in ("sedan", "pickup"))
    assert (BODIES["scooter"].station_type, BODIES["bus"].station_type) == (
        StationType.MOPED,
        StationType.BUS,
    )
    assert [name for name, body in BODIES.items() if body.trailer] == ["semi_trailer"]
