"""Cars parked in bays along the kerb."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.scenario.fleet import CAR_SHARES
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant, variants_of
from advpipe.stages.simulate.road_network.roads import KERB_M, Roads
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.occupied import Occupied
from advpipe.stages.simulate.world.raycast.plots import plots_along

PARKED_OFFSET_M = (1.0, 1.6)
"""Where the middle of a parked car may stand, from the kerb: on the edge of the pavement, or away from it."""

ASKEW_SHARE, ASKEW_RAD = 0.15, np.deg2rad(12.0)
"""Share of the parked cars that stand askew, and by how much at most: more would reach into the walkway."""

PARKED_VANS = 0.06
"""Share of vans among parked vehicles; the others are cars, in the shares of the fleet."""

PARKED = {body: (1 - PARKED_VANS) * share for body, share in CAR_SHARES.items()} | {"van": PARKED_VANS}


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
        body = list(PARKED)[int(rng.choice(len(PARKED), p=list(PARKED.values())))]
        of_body = variants_of(variants, body)
        variant = variants[of_body[int(rng.integers(len(of_body)))]]
        turned = rng.random() < 0.15
        askew_rad = ASKEW_RAD if rng.random() < ASKEW_SHARE else 0.0
        turn_rad = np.pi * float(turned) + rng.normal(0.0, 0.03) + rng.uniform(-1, 1) * askew_rad
        pitch_rad = float(np.arctan(slope)) * (1 if turned else -1)
        pose = plot.at(rng.uniform(*PARKED_OFFSET_M), KERB_M, turn_rad, pitch_rad)
        if occupied.take(pose, variant.length_m + 0.6, variant.width_m + 0.1):
            parked.append(RoadUser(f"parked.{len(parked)}", variant, pose, np.zeros(3)))
    return parked
