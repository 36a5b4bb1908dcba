"""What a station perceives, in its CPMs: by hand, without errors."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.cpm import Cpm
from advpipe.pipeline.v2x.facilities.cpm_tree import decode_cpm
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.stages.simulate.network.embedded.cpm_service import CpmService
from advpipe.stages.simulate.network.protocol import Perceived

NOW_NS = 1_800_000_000 * 10**9
STATE = StationState(
    station_id=1,
    station_type=5,
    time_ns=NOW_NS,
    latitude_deg=48.1,
    longitude_deg=11.5,
    heading_rad=math.radians(90),  # to the east
    speed_mps=0.0,
    length_m=4.0,
    width_m=1.8,
)
EXACT = CpmRules(position_stddev_m=0, speed_stddev_mps=0, heading_stddev_deg=0)


def box(x_m: float, y_m: float, velocity_mps: tuple[float, float, float] = (0, 0, 0)) -> Boxes:
    geometry = np.array([[x_m, y_m, 0.75, 4.5, 1.8, 1.5, math.pi / 2]])
    return Boxes(geometry, np.zeros(1, np.int64), ("other",), np.array([velocity_mps], np.float64))


def service(seen: list[Perceived]) -> tuple[CpmService, SimpleNamespace]:
    """A service of a vehicle at the origin of the map that heads east, and perceives `seen` one by one."""
    user = SimpleNamespace(id="own", map_SE3_base=np.eye(4), variant=SimpleNamespace(length_m=4.0))
    station = SimpleNamespace(user=user, dcc_interval_s=0.0)
    return CpmService(EXACT, 1, station, NOW_NS, lambda _: seen.pop(0)), user


def sent(made: CpmService, user: SimpleNamespace, steps: int, first: int = 0) -> list[Cpm]:
    found = []
    for step in range(first, first + steps):
        now_ns = NOW_NS + step * 10**8
        made.update(now_ns, replace(STATE, time_ns=now_ns), user, {})
        found += [decode_cpm(one.payload) for one in made.messages_before(now_ns + 10**8)]
    return found


def test_an_object_is_stated_from_the_front_of_the_vehicle() -> None:
    (cpm,) = sent(*service([Perceived(box(20.0, 5.0, (0.0, 3.0, 0.0)))]), 1)
    (one,) = cpm.objects
    assert (one.east_m, one.north_m, one.up_m) == pytest.approx((18.0, 5.0, 0.75), abs=0.01)
    assert (one.east_mps, one.north_mps) == pytest.approx((0.0, 3.0), abs=0.01)
    assert one.yaw_rad == pytest.approx(math.pi / 2, abs=0.01)


def test_an_object_keeps_its_id_unless_it_was_out_of_sight_for_long() -> None:
    here, gone = Perceived(box(20.0, 5.0)), Perceived()
    ids = {
        pause: [
            cpm.objects[0].object_id
            for cpm in sent(*service([here, *[gone] * pause, here]), pause + 2)
            if cpm.objects
        ]
        for pause in (5, 15)
    }
    assert len(set(ids[5])) == 1
    assert len(set(ids[15])) == 2


def test_another_station_id_brings_other_object_ids() -> None:
    here = Perceived(box(20.0, 5.0))
    made, user = service([here] * 4)
    (before,) = sent(made, user, 1)
    made.rename(2)
    after = sent(made, user, 2, first=1)
    assert not {one.object_id for one in before.objects} & {
        one.object_id for cpm in after for one in cpm.objects
    }
