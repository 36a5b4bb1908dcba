"""Spoofing reaches what lies downstream of the receiver, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.localisation import estimate_message, read_measurements
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.localisation.monitor import windowed_alarms
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.replay.recorded_filter import read_filter
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.change import changed_messages
from advpipe.stages.attack.gnss.change import spoof

EGO = VehicleTopics("ego")
FROM_S = 3.0
SCHEDULE = {"from_s": FROM_S}


def change(reader: BagReader, *specs: dict, seed: int = 7):
    return spoof(reader, [attack_spec(spec) for spec in specs], seed)


def cdrs(raws, topic: str) -> list[bytes]:
    return [raw.cdr for raw in raws if raw.topic.name == topic]


def decoded(reader: BagReader, raws, topic: str) -> list:
    return [reader.decode(raw) for raw in raws if raw.topic.name == topic]


@pytest.fixture(scope="session")
def biased(drive: BagReader):
    """A bias of `ego` from 3 s on."""
    made = change(drive, {"type": "gnss-bias", "victim": "ego", "schedule": SCHEDULE})
    return made, list(made.messages())


def test_without_a_false_fix_every_byte_stays(drive):
    made = change(drive, {"type": "gnss-drift", "parameters": {"rate_mps": 0}}, {**JAM, "victim": "other"})
    assert made.topics == {*(f"/{v}/{t}" for v in ("ego", "other") for t in ("gnss/fix", "odometry")), "/tf"}
    new = list(made.messages())
    for topic in ("/ego/gnss/fix", "/ego/odometry"):
        assert cdrs(new, topic) == cdrs(drive.raw_messages([topic]), topic)
    times = [raw.log_time_ns for raw in drive.raw_messages(made.topics)]
    assert [raw.log_time_ns for raw in new] == times
    with_nothing = change(drive, {"type": "gnss-drift", "parameters": {"rate_mps": 0}})
    assert [raw.cdr for raw in with_nothing.messages()] == [
        raw.cdr for raw in drive.raw_messages(with_nothing.topics)
    ]
    assert not with_nothing.counts()  # each fix is attacked, and none is false


JAM = {"type": "gnss-jam", "schedule": {"from_s": 2, "to_s": 4}}


def test_the_fix_is_off_by_the_bias_and_keeps_its_claims(drive, biased):
    made, new = biased
    (delta,) = {
        tuple(np.round(one.false_fix.position_m - one.true_m, 9))
        for one in made.vehicles[0].records
        if one.false_fix
    }
    old_fixes, new_fixes = (decoded(drive, raws, EGO.gnss_fix.name) for raws in (drive.raw_messages(), new))
    geodesy = read_filter(drive).geodesy
    for index, (old, fix) in enumerate(zip(old_fixes, new_fixes, strict=True)):
        places = [geodesy.to_map([one.latitude, one.longitude, one.altitude]) for one in (old, fix)]
        expected = delta if index >= 10 * FROM_S else (0, 0, 0)
        assert np.allclose(places[1] - places[0], expected, atol=1e-6)
        assert fix.header == old.header
        assert np.array_equal(fix.position_covariance, old.position_covariance)


def test_odometry_and_tf_follow_from_the_first_false_fix_on(drive, biased):
    _, new = biased
    before = round(10 * FROM_S)
    old_odometry = cdrs(drive.raw_messages(), EGO.odometry.name)
    assert cdrs(new, EGO.odometry.name)[:before] == old_odometry[:before]
    assert not set(cdrs(new, EGO.odometry.name)[before:]) & set(old_odometry)
    for old, transforms, odometry in zip(
        decoded(drive, drive.raw_messages(), "/tf"),
        decoded(drive, new, "/tf"),
        decoded(drive, new, EGO.odometry.name),
        strict=True,
    ):
        found = {one.child_frame_id: one for one in transforms.transforms}
        recorded = {one.child_frame_id: one for one in old.transforms}
        assert list(found) == list(recorded)
        assert found["other/base_link"] == recorded["other/base_link"]
        ego = build.se3_from_transform(found["ego/base_link"].transform)
        assert np.array_equal(ego, build.se3_from_pose(odometry.pose.pose))


def test_the_written_bag_is_what_a_filter_makes_of_its_fixes(drive, biased, tmp_path: Path):
    """A reader that knows of no attack gets the bag's odometry from the bag's own fixes, to the bit."""
    made, _ = biased
    with BagWriter(tmp_path / "attacked", provenance={}) as bag:
        for raw in changed_messages(drive, [made]):
            bag.copy(raw)
    reader = BagReader(tmp_path / "attacked")
    estimator = read_filter(reader).estimator(reader, EGO)
    again = [
        serialise(estimate_message(EGO, estimator.step(measured))[1], EGO.odometry.type)
        for measured in read_measurements(reader, EGO)
    ]
    assert again == cdrs(reader.raw_messages(), EGO.odometry.name)
    assert again != cdrs(drive.raw_messages(), EGO.odometry.name)
    untouched = [name for name in drive.topics if name not in made.topics]
    pairs = zip(drive.raw_messages(untouched), reader.raw_messages(untouched), strict=True)
    assert all(old.cdr == new.cdr for old, new in pairs)


def test_the_estimate_goes_where_the_fixes_go(drive):
    """Its own wandering offset explains a part of a small bias, but not 100 m."""
    far = {"type": "gnss-relocate", "parameters": {"least_m": 100, "most_m": 100}, "schedule": SCHEDULE}
    made = change(drive, far)
    truth = decoded(drive, drive.raw_messages(), EGO.true_odometry.name)
    estimates = [one.map_SE3_base[:3, 3] for one in made.vehicles[0].estimates.values()]
    errors = [
        np.hypot(*(estimate - build.se3_from_pose(one.pose.pose)[:3, 3])[:2])
        for estimate, one in zip(estimates, truth, strict=True)
    ]
    assert max(errors[5:30]) < 6
    assert errors[-1] > 60


def test_jammed(drive):
    made = change(drive, JAM)
    fixes = decoded(drive, made.messages(), EGO.gnss_fix.name)
    jammed = [fix.status.status == -1 for fix in fixes]
    assert [index for index, one in enumerate(jammed) if one] == list(range(20, 40))
    assert all(np.isnan([fix.latitude, fix.longitude, fix.altitude]).all() for fix in fixes[20:40])
    assert made.counts() == {"fixes missing": 20}
    innovations = [estimate.innovation for estimate in made.vehicles[0].estimates.values()]
    assert [innovation is None for innovation in innovations] == jammed


def test_an_aware_drift_passes_the_test_that_a_blind_one_fails(drive):
    moved_m: list[float] = []

    def squares(kind: str, **parameters: object) -> np.ndarray:
        spec = {"type": kind, "parameters": parameters, "schedule": {"from_s": 2}}
        vehicle = change(drive, spec).vehicles[0]
        last = vehicle.records[-1]
        moved_m.append(float(np.linalg.norm(last.false_fix.position_m - last.true_m)))
        return np.array([estimate.innovation.nis for estimate in vehicle.estimates.values()])

    gate = 16.266237  # chi-square, 3 degrees of freedom, 99.9 %
    assert (squares("gnss-drift", rate_mps=10)[20:] > gate).sum() > 5
    aware = squares("gnss-drift-aware")
    assert aware[20:].max() <= 0.7 * gate + 1e-6
    assert windowed_alarms(aware)[20:].mean() > 0.5
    wary = squares("gnss-drift-aware", monitor="window")
    assert not windowed_alarms(wary)[20:].any()
    slow = squares("gnss-drift-aware", rate_mps=1)
    assert slow[20:].max() <= 0.7 * gate + 1e-6
    assert moved_m[1] > 3 * moved_m[3] > 3
    assert moved_m[1] > moved_m[2] > 3


def test_labels(drive, biased, tmp_path: Path):
    made, _ = biased
    made.write_labels(tmp_path)
    table = pq.read_table(tmp_path / "gnss_labels.parquet").to_pylist()
    assert [row["fix"] for row in table] == list(range(80))
    assert {row["vehicle"] for row in table} == {"ego"}
    assert [row["attack"] for row in table] == [None] * 30 + ["gnss-bias"] * 50
    (delta,) = {tuple(row[f"offset_{axis}_m"] for axis in ("east", "north", "up")) for row in table[40:41]}
    # variances of the default receiver: 0.3^2 + 1 m^2 to the east and north, four times that in height
    expected = (delta[0] ** 2 + delta[1] ** 2) / 1.09 + delta[2] ** 2 / 4.36
    assert table[40]["squared_sigmas"] == pytest.approx(expected)
    assert table[40]["mattered"] == (np.hypot(delta[0], delta[1]) > 1.0 or abs(delta[2]) > 5.0)
    assert table[0]["true_latitude_deg"] == table[0]["false_latitude_deg"]
    assert not table[0]["mattered"]
    fixes = decoded(drive, drive.raw_messages(), EGO.gnss_fix.name)
    assert [row["true_latitude_deg"] for row in table] == [fix.latitude for fix in fixes]


def test_labels_without_a_fix(drive, tmp_path: Path):
    change(drive, JAM).write_labels(tmp_path)
    row = pq.read_table(tmp_path / "gnss_labels.parquet").to_pylist()[25]
    assert (row["attack"], row["mattered"]) == ("gnss-jam", True)
    assert row["false_latitude_deg"] is None
    assert row["squared_sigmas"] is None
    assert row["true_latitude_deg"] is not None


def test_the_same_seed_gives_the_same_bytes(drive, biased):
    spec = {"type": "gnss-bias", "victim": "ego", "schedule": SCHEDULE}
    new = [raw.cdr for raw in biased[1]]
    assert [raw.cdr for raw in change(drive, spec).messages()] == new
    assert [raw.cdr for raw in change(drive, spec, seed=8).messages()] != new
    assert [raw.cdr for raw in change(drive, {**spec, "seed_name": "b"}).messages()] != new


def test_refuses_victims_that_are_not_there(drive, tmp_path: Path):
    with pytest.raises(AdvpipeError, match="no vehicle 'bus' with GPS or CAMs; those with GPS: ego, other"):
        change(drive, {"type": "gnss-jam", "victim": "bus"})
    with pytest.raises(AdvpipeError, match=r"no vehicle 'otter' .*; did you mean 'other'\?"):
        change(drive, {"type": "gnss-jam", "victim": "otter"})
    with BagWriter(tmp_path / "blind", provenance={}) as bag:
        for raw in drive.raw_messages(["/ego/lidar/points", SCENARIO_INFO.name]):
            bag.copy(raw)
    blind = BagReader(tmp_path / "blind")
    with pytest.raises(AdvpipeError, match="has no vehicle with GPS"):
        change(blind, {"type": "gnss-jam"})
    with pytest.raises(AdvpipeError, match="no vehicle 'ego' with GPS or CAMs"):
        change(blind, {"type": "gnss-jam", "victim": "ego"})


def test_refuses_a_bag_that_does_not_tell_how_to_run_the_filter(drive, tmp_path: Path):
    def without(name: str, *left_out: str) -> BagReader:
        with BagWriter(tmp_path / name, provenance={}) as bag:
            for raw in drive.raw_messages():
                if raw.topic.name not in left_out and raw.topic.name.startswith(("/ego", "/scen", "/tf")):
                    bag.copy(raw)
        return BagReader(tmp_path / name)

    with pytest.raises(AdvpipeError, match="has fixes of ego, but not its estimate"):
        change(without("poseless", EGO.initial_pose.name), {**JAM, "victim": "ego"})
    with pytest.raises(AdvpipeError, match="has no /scenario/info"):
        change(without("nameless", SCENARIO_INFO.name), JAM)


def test_a_place_without_a_fix_is_left_alone(drive, tmp_path: Path):
    """Fixes that were missing anyway are neither attacked nor counted as harmed."""
    with BagWriter(tmp_path / "gaps", provenance={}) as bag:
        for raw in drive.raw_messages():
            if raw.topic.name == EGO.gnss_fix.name:
                fix = drive.decode(raw)
                if build.stamp_ns(fix) % 1_000_000_000 < 500_000_000:
                    fix = replace(fix, status=replace(fix.status, status=-1))
                raw = replace(raw, cdr=serialise(fix, raw.topic.type))
            bag.copy(raw)
    gaps = BagReader(tmp_path / "gaps")
    made = change(gaps, {"type": "gnss-freeze"})
    records = made.vehicles[0].records
    assert [one.true_geographic is None for one in records] == [index % 10 < 5 for index in range(80)]
    assert all(one.false_fix is None for one in records if one.true_geographic is None)
    old = cdrs(gaps.raw_messages(), EGO.gnss_fix.name)
    assert cdrs(made.messages(), EGO.gnss_fix.name)[:5] == old[:5]
