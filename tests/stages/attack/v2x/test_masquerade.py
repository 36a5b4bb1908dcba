from __future__ import annotations

import pytest
from v2x_lane import context, decoded, edited, lane

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.facilities.ldm import LocalDynamicMap, Verdict
from advpipe.pipeline.v2x.section import LdmRules
from advpipe.stages.attack.v2x.masquerade import Masquerade

STARTS_M = {1: 0.0, 2: 80.0, 3: -50.0, 4: 300.0}
DRIVE = lane(STARTS_M, 20)


def masks(attack, drive=DRIVE):
    return [decoded(one)[0].station_id for one in edited(attack, drive) if one.station_id == 1]


def test_the_nearest_station_is_impersonated_while_in_range():
    """Station 3, 50 m behind, leaves after 1 s; then 2 is nearest."""
    drive = lane(STARTS_M, 20, leaves={3: 10})
    assert masks(Masquerade(context("cam-masquerade")), drive) == 10 * [3] + 10 * [2]


def test_the_state_remains_the_attackers():
    after = [one for one in edited(Masquerade(context("cam-masquerade")), DRIVE) if one.station_id == 1]
    report = decoded(after[10])[1]
    assert report.front_m[0] == pytest.approx(12.25, abs=0.02)


def test_other_attackers_are_never_impersonated():
    attack = Masquerade(context("cam-masquerade", attackers=(1, 3)), identity="each", range_m=200.0)
    assert set(masks(attack)) == {2}
    attack = Masquerade(context("cam-masquerade"), identity="each")
    assert set(masks(attack)) == {2, 3, 4}
    assert len(set(masks(Masquerade(context("cam-masquerade"), identity="random")))) == 1
    assert masks(Masquerade(context("cam-masquerade"), range_m=10.0)) == 20 * [1]


def test_the_victim_is_impersonated():
    assert masks(Masquerade(context("cam-masquerade", victim=4), identity="victim")) == 20 * [4]
    with pytest.raises(AdvpipeError, match="identity is 'victim', but no victim is given"):
        Masquerade(context("cam-masquerade"), identity="victim")


@pytest.mark.parametrize(("ahead_s", "lasts"), [(0.0, False), (0.9, True)])
def test_the_stations_ldm_entry_is_overwritten(ahead_s, lasts):
    """Without a time in the future, the truth comes back with the station's next message."""
    attack = Masquerade(context("cam-masquerade"), ahead_s=ahead_s)
    known, fronts_m = LocalDynamicMap(LdmRules()), []
    for one in edited(attack, DRIVE):
        report = decoded(one)[1]
        verdict = known.receive(report, one.request_ns)
        if one.station_id == 3:
            entry = next(e for e in known.snapshot(one.request_ns).entries if e.report.station_id == 3)
            fronts_m.append(entry.report.front_m[0] - 10 * (one.number // 1000) / 10)
            assert (verdict is Verdict.SUPERSEDED) == lasts
    expected_m = 2.25 if lasts else -47.75
    assert fronts_m == pytest.approx([expected_m] * 20, abs=0.02)
