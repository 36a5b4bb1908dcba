"""Cars parked in bays along the kerb."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant, variants_of
from advpipe.stages.simulate.road_network.roads import KERB_M, Roads
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.occupied import Occupied
from advpipe.stages.simulate.world.raycast.plots import plots_along

PARKED_OFFSET_M = 1.35
PARKED_BODIES = ("sedan", "hatchback", "estate", "suv", "pickup", "van")
PARKED_SHARES = (0.26, 0.26, 0.12, 0.25, 0.04, 0.07)


def park_cars(
    scenario: Scenario,
    roads: Roads,
    variants: dict[str, Variant],
    occupied: Occupied,
    rng: np.random.Generator,
) -> list[RoadUser]:
    """Cars in bays along the kerb, a few facing the wrong way or a little askew.

    They never move, and are part of the ground truth.
    """
    parked: list[RoadUser] = []
    for plot, slope in plots_along(roads.kerbs_m, scenario.traffic.parked_per_km, rng):
        body = PARKED_BODIES[int(rng.choice(len(PARKED_BODIES), p=PARKED_SHARES))]
        of_body = variants_of(variants, body)
        variant = variants[of_body[int(rng.integers(len(of_body)))]]
        turned = rng.random() < 0.15
        turn_rad = np.pi * float(turned) + rng.normal(0.0, 0.03)
        pitch_rad = float(np.arctan(slope)) * (1 if turned else -1)
        pose = plot.at(PARKED_OFFSET_M + rng.normal(0, 0.08), KERB_M, turn_rad, pitch_rad)
        if occupied.take(pose, variant.length_m + 0.6, variant.width_m + 0.1):
            parked.append(RoadUser(f"parked.{len(parked)}", variant, pose, np.zeros(3)))
    return parked
