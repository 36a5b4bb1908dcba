"""Bodies: those that the scenario knows, drawn in a few sizes and colours."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.scenario.traffic import BODIES as DRIVEN
from advpipe.pipeline.scenario.traffic import PEOPLE, Traffic
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.stages.simulate.bodies import BODIES, VARIANTS, draw_variants


def test_the_scenario_lists_exactly_the_bodies_that_drive() -> None:
    assert [name for name, body in BODIES.items() if body.label != "pedestrian"] == list(DRIVEN)
    assert set(Traffic().mix) == set(DRIVEN)
    assert sum(Traffic().mix.values()) == pytest.approx(1.0)
    assert len(DRIVEN) >= 13


def test_scenario_body_names_match_the_bodies() -> None:
    assert {*DRIVEN, *PEOPLE} == set(BODIES)
    assert {body.label for body in BODIES.values()} == set(CLASSES)


def test_variants_differ_a_little_and_follow_the_seed() -> None:
    first, again, other = (draw_variants(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert len(first) == VARIANTS * len(BODIES)
    assert first == again
    assert first != other
    for variant in first.values():
        assert variant.length_m == pytest.approx(variant.body.length_m, rel=0.075)


def test_bodies_have_the_right_station_types() -> None:
    silent = {name for name, body in BODIES.items() if body.station_type is None}
    assert silent == {"bicycle", *PEOPLE}
    assert all(BODIES[name].station_type == StationType.PASSENGER_CAR for name in ("sedan", "pickup"))
    assert (BODIES["scooter"].station_type, BODIES["bus"].station_type) == (
        StationType.MOPED,
        StationType.BUS,
    )
    assert [name for name, body in BODIES.items() if body.trailer] == ["semi_trailer"]
