"""GPS, V2X and LiDAR attacks in one bag of a recorded drive: what is new, and what is untouched."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.v2x import stations_of_message
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.job import Job
from advpipe.stages.attack.run import AttackRequest, attack, attack_id
from advpipe.stages.simulate.run import simulate

LIDAR, FIX, CAMS = "/ego/lidar/points", "/ego/gnss/fix", "/v2x/sent"
SPAN = Schedule(from_s=1, to_s=2)
GPS = AttackSpec(type="paa", victim="ego", schedule=SPAN)
SPEED = AttackSpec(
    type="cam-speed-constant", attackers={"share": 1.0}, parameters={"speed_mps": 30}, schedule=SPAN
)


def detach(**keys):
    """At random: the small detector of these tests sees nothing of this drive."""
    ours = {"parameters": {"ratio": 0.05}, "detector": "linear_detector:Shipped"}
    return AttackSpec(type="detach", recipe="random", **ours, **keys)


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """Three seconds with V2X; 30 clouds."""
    out = tmp_path_factory.mktemp("coordinated") / "drive"
    lidar = "sensors.lidars.lidar"
    settings = ["simulation.duration_s=3", f"{lidar}.channels=8", f"{lidar}.points_per_second=20000"]
    simulate(load_scenario("smoke", [*settings, "v2x.penetration=1", "recording.markers=false"]), out)
    return out / "clean"


def by_topic(bag):
    found = {}
    for raw in BagReader(bag).raw_messages():
        found.setdefault(raw.topic.name, []).append(raw)
    return found


def files_of(folder):
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def test_three_families_strike_in_the_same_second(drive, tmp_path):
    lidar = detach(schedule=SPAN, frames="::5")
    summary = attack(drive, tmp_path / "adv", AttackRequest((lidar, SPEED, GPS), 7))  # in any order
    clean, adversarial = by_topic(drive), by_topic(tmp_path / "adv")
    changed = {topic for topic in clean if clean[topic] != adversarial[topic]}
    untouched = {"/clock", "/tf_static", "/scenario/info", "/ego/ground_truth/odometry", "/ego/imu"}
    assert not changed & (untouched | {"/ego/ground_truth/objects", "/v2x/stations", "/ego/wheel/odometry"})
    assert {LIDAR, FIX, CAMS, "/tf", "/ego/odometry"} <= changed
    assert summary.replaced >= {FIX, CAMS}
    # Of the clouds, every fifth is there, and those of the span are attacked; nothing else is left out.
    assert len(adversarial[LIDAR]) == 6
    assert [len(clean[topic]) for topic in untouched] == [len(adversarial[topic]) for topic in untouched]
    frames = pq.read_table(str(tmp_path / "adv" / "frames.parquet")).to_pylist()
    assert [row["frame"] for row in frames] == [0, 5, 10, 15, 20, 25]
    assert [row["attack"] for row in frames] == ["", "", "detach", "detach", "", ""]
    # The GPS leaps for a second, by 50 to 150 m.
    start_ns = clean[FIX][0].log_time_ns
    reader = BagReader(drive)
    for before, after in zip(clean[FIX], adversarial[FIX], strict=True):
        is_on = 1 <= (before.log_time_ns - start_ns) / 1e9 < 2
        fixes = [reader.decode(raw) for raw in (before, after)]
        north_m = (fixes[1].latitude - fixes[0].latitude) * 111_200
        east_m = (fixes[1].longitude - fixes[0].longitude) * 111_300 * np.cos(np.radians(fixes[0].latitude))
        assert (49 < np.hypot(north_m, east_m) < 151) == is_on
    for name in ("labels.parquet", "gnss_labels.parquet", "v2x_labels.parquet"):
        assert pq.read_table(str(tmp_path / "adv" / name)).num_rows > 0
    resolved = yaml.safe_load((tmp_path / "adv" / "attack.yaml").read_text())
    assert resolved["attack"] == "detach+cam-speed-constant+gnss-relocate"
    assert (resolved["recipe"], resolved["budget"]) == ("random", "ratio")  # of the clouds
    assert json.loads(BagReader(tmp_path / "adv").provenance["attacks"]) == resolved["attacks"]
    assert resolved["attacks"][2]["parameters"]["least_m"] == 50.0
    assert len(list(read_frames(tmp_path / "adv"))) == 6  # the truth still fits the clouds


def test_the_shipped_coordinated_attack_attacks_one_victim_at_one_time(drive, tmp_path):
    """The scenario's own attacks, in the second second of a short drive: jam, false GPS, hidden points."""
    scenario = load_scenario("coordinated", [])
    shipped = scenario.attacks["coordinated"]
    assert set(scenario.vehicles) == {"ego", "other"}  # in whose map the victim is where it is not
    assert [spec.type for spec in shipped] == ["cam-sybil-congestion", "gnss-relocate", "detach"]
    assert {(spec.victim, spec.schedule) for spec in shipped} == {("ego", shipped[0].schedule)}
    ours = {"schedule": SPAN}
    ours_lidar = {"recipe": "random", "detector": "linear_detector:Shipped", "frames": "::3"}
    specs = [spec.model_copy(update=ours | (ours_lidar if spec.type == "detach" else {})) for spec in shipped]
    summary = attack(drive, tmp_path / "adv", AttackRequest(tuple(specs), 1))
    fixes, messages, frames, points = (
        pq.read_table(str(tmp_path / "adv" / f"{name}.parquet"))
        for name in ("gnss_labels", "v2x_labels", "frames", "labels")
    )
    reader = BagReader(drive)
    clouds_ns = reader.log_times_ns(LIDAR)
    start_ns = min(int(times[0]) for times in map(reader.log_times_ns, reader.topics) if len(times))
    lied = [row for row in fixes.to_pylist() if row["attack"] is not None]
    jam = [row for row in messages.to_pylist() if row["attack"] == "cam-sybil-congestion"]
    hit = [row for row in frames.to_pylist() if row["attack"] == "detach"]
    assert {row["vehicle"] for row in lied} == {"ego"}
    assert {row["topic"] for row in hit} == {LIDAR}
    assert points.num_rows > 0
    spans_s = [
        (min(times) / 1e9, max(times) / 1e9)
        for times in (
            [row["stamp_ns"] - start_ns for row in lied],
            [row["time_ns"] - start_ns for row in jam],
            [int(clouds_ns[row["frame"]]) - start_ns for row in hit],
        )
    ]
    assert all(1 <= first < last < 2 for first, last in spans_s)
    assert max(first for first, _ in spans_s) < min(last for _, last in spans_s) - 0.5
    # All ghosts stand ahead of the same vehicle: within the jam's reach of where it truly is, not astern.
    places = {radio.vehicle: radio.map_SE3_base for radio in _radios_at(reader, start_ns + 1_500_000_000)}
    for row in jam:
        ahead_m, left_m = (
            np.linalg.inv(places["ego"]) @ [row["false_x_m"], row["false_y_m"], places["ego"][2, 3], 1]
        )[:2]
        assert -5 < ahead_m < 100
        assert abs(left_m) < 15
    text = str(summary)
    assert f"{len(lied)} fixes spoofed" in text
    assert f"{len(jam):,} CAMs added" in text


def _radios_at(reader, time_ns):
    stations = [raw for raw in reader.raw_messages(["/v2x/stations"]) if raw.log_time_ns <= time_ns]
    return stations_of_message(reader.decode(stations[-1]))


def test_messages_alone_need_no_clouds_and_keep_all(drive, tmp_path):
    attack(drive, tmp_path / "adv", AttackRequest((SPEED,), 7))
    clean, adversarial = by_topic(drive), by_topic(tmp_path / "adv")
    assert clean[LIDAR] == adversarial[LIDAR]
    assert clean[FIX] == adversarial[FIX]
    assert clean[CAMS] != adversarial[CAMS]
    assert not (tmp_path / "adv" / "labels.parquet").exists()
    assert yaml.safe_load((tmp_path / "adv" / "attack.yaml").read_text())["frames"] == "0::1"


@pytest.mark.nightly  # test_run.py has each of these for an attack on clouds alone
def test_same_bytes_in_one_go_in_pieces_and_on_two_workers(drive, tmp_path, monkeypatch):
    monkeypatch.setattr("advpipe.pipeline.core.jobs.JOBS_WORTH_A_WORKER", 1)
    request = AttackRequest((detach(frames="::10"), SPEED, GPS), 7)
    attack(drive, tmp_path / "one" / "adv", request, workers=1)
    attack(drive, tmp_path / "two" / "adv", request, workers=2)
    whole = files_of(tmp_path / "one" / "adv")
    assert files_of(tmp_path / "two" / "adv") == whole
    stored, most, store = [], [2], Job.store

    def interrupted(self, index, result):
        if len(stored) == most[0]:
            raise KeyboardInterrupt
        stored.append(index)
        store(self, index, result)

    monkeypatch.setattr(Job, "store", interrupted)
    with pytest.raises(KeyboardInterrupt):
        attack(drive, tmp_path / "pieces" / "adv", request, workers=1)
    assert not (tmp_path / "pieces" / "adv").exists()
    assert stored == [0, 1]
    most[0] = 99
    attack(drive, tmp_path / "pieces" / "adv", request, workers=1)
    assert stored == [0, 1, 2]
    assert files_of(tmp_path / "pieces" / "adv") == whole


def test_attacks_that_do_not_meet_are_none(drive, tmp_path):
    """The same field by others, at another time, or another field: one after the other, by all of them."""
    ego, others = {"vehicles": ["ego"]}, {"share": 0.5}
    specs = (
        AttackSpec(type="cam-speed-offset", attackers=ego, schedule={"to_s": 1}),
        AttackSpec(type="cam-speed-frozen", attackers=ego, schedule={"from_s": 1}),
        AttackSpec(type="cam-heading-reversed", attackers=ego),
        AttackSpec(type="cam-sudden-stop", attackers=others),
    )
    attack(drive, tmp_path / "adv", AttackRequest(specs))
    labels = pq.read_table(str(tmp_path / "adv" / "v2x_labels.parquet"))
    assert labels.num_rows > 0


@pytest.mark.parametrize(
    ("specs", "line"),
    [
        (
            [
                AttackSpec(type="cam-speed-offset", attackers={"vehicles": ["ego"]}),
                AttackSpec(type="cam-sudden-stop", attackers={"vehicles": ["ego"]}),
            ],
            "cam-speed-offset and cam-sudden-stop contradict each other: both set the speed",
        ),
        (
            [GPS, AttackSpec(type="gnss-drift")],
            "gnss-relocate and gnss-drift both spoof ego",
        ),
        ([AttackSpec(type="cam-dos", attackers={"vehicles": ["nobody"]})], "attacker 'nobody' has no radio"),
        ([AttackSpec(type="cam-dos", schedule={"from_s": 3.5})], "begins at 3.5 s, but the recording ends"),
        ([AttackSpec(type="gnss-drift", victim="nobody")], "no vehicle 'nobody' with GPS"),
        ([AttackSpec(type="cam-ghost-stop", victim="nobody")], "victim 'nobody' has no radio"),
        ([detach(victim="nobody")], "no clouds of the victim 'nobody'"),
        (
            [AttackSpec(type="cam-speed-constant", parameters={"speed": 1})],
            "unknown parameter 'speed'",
        ),
        ([AttackSpec(type="cam-nothing")], "unknown attack 'cam-nothing'; "),
    ],
)
def test_what_cannot_be_done_is_refused(drive, tmp_path, specs, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        attack(drive, tmp_path / "adv", AttackRequest(tuple(specs)))
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_bag_without_v2x_and_gps(clean_bag, tmp_path):
    with pytest.raises(AdvpipeError, match="no V2X to replay"):
        attack(clean_bag, tmp_path / "adv", AttackRequest((AttackSpec(type="cam-dos"),)))
    with pytest.raises(AdvpipeError, match="no vehicle with GPS"):
        attack(clean_bag, tmp_path / "adv", AttackRequest((AttackSpec(type="gnss-bias"),)))
    assert [item.name for item in tmp_path.iterdir()] == ["clean"]


def test_its_name():
    assert attack_id(AttackRequest((GPS, detach()))) == "gnss-relocate+detach-random-0.05"
    assert attack_id(AttackRequest((SPEED,))).startswith("cam-speed-constant-speed_mps30")


def test_viewers_see_false_and_believed_positions_beside_the_true_ones(drive, tmp_path):
    offset = AttackSpec(type="cam-position-offset", attackers={"share": 1.0}, schedule=SPAN)
    attack(drive, tmp_path / "adv", AttackRequest((offset, GPS), 7))
    labels = pq.read_table(tmp_path / "adv" / "v2x_labels.parquet").to_pylist()
    claimed = {(row["sent_ns"], row["true_station_id"]): row for row in labels}
    reader, seen = BagReader(tmp_path / "adv", debug=True), 0
    for _, message in reader.messages(f"/advpipe/debug{CAMS}"):
        for marker in message.markers:
            if marker.ns in ("true", "false"):
                rows = [row for (_, station), row in claimed.items() if station % 2**31 == marker.id]
                places = {(row[f"{marker.ns}_x_m"], row[f"{marker.ns}_y_m"]) for row in rows}
                assert (marker.pose.position.x, marker.pose.position.y) in places
                seen += 1
    assert (
        seen >= 2 * len({row["number"] for row in labels}) * 0.9
    )  # the last of a station's in a step is shown
    fixes = pq.read_table(tmp_path / "adv" / "gnss_labels.parquet").to_pylist()
    spoofed = [row for row in fixes if row["attack"]]
    shown = list(reader.messages(f"/advpipe/debug{FIX}"))
    assert [time_ns for time_ns, _ in shown] == [row["stamp_ns"] for row in spoofed]
    believed = dict(reader.messages("/ego/odometry"))
    for (time_ns, message), row in zip(shown, spoofed, strict=True):
        place = {one.ns: one.pose.position for one in message.markers}
        offset_m = [getattr(place["false"], axis) - getattr(place["true"], axis) for axis in "xyz"]
        expected_m = [row[f"offset_{axis}_m"] for axis in ("east", "north", "up")]
        np.testing.assert_allclose(offset_m, expected_m, atol=1e-6)
        assert place["believed"].x == believed[time_ns].pose.pose.position.x
    times_ns = [raw.log_time_ns for raw in reader.raw_messages()]
    assert times_ns == sorted(times_ns)


def test_viewers_see_where_messages_were_dropped(drive, tmp_path):
    drop = AttackSpec(type="cam-drop", attackers={"share": 1.0}, schedule=SPAN)
    attack(drive, tmp_path / "adv", AttackRequest((drop,), 7))
    labels = pq.read_table(tmp_path / "adv" / "v2x_labels.parquet").to_pylist()
    assert {row["action"] for row in labels} == {"dropped"}
    reader = BagReader(tmp_path / "adv", debug=True)
    shown = [each for _, message in reader.messages(f"/advpipe/debug{CAMS}") for each in message.markers]
    places = {(one.id, one.pose.position.x, one.pose.position.y) for one in shown if one.ns == "not sent"}
    stated = {(row["station_id"] % 2**31, row["true_x_m"], row["true_y_m"]) for row in labels}
    assert places <= stated  # the last of a station's in a step is shown
    assert len(places) >= 0.9 * len(stated)
    assert {one.text for one in shown if one.ns == "not sent label"} == {"cam-drop: not sent"}


def test_without_debug_only_the_debug_topics_are_missing(drive, tmp_path):
    attack(drive, tmp_path / "with", AttackRequest((SPEED, GPS, detach()), 7))
    attack(drive, tmp_path / "without", AttackRequest((SPEED, GPS, detach()), 7, debug=False))
    full, plain = (BagReader(tmp_path / name, debug=True) for name in ("with", "without"))
    debug = {f"/advpipe/debug{name}" for name in (LIDAR, CAMS, FIX)}
    assert full.topics.keys() - plain.topics.keys() == debug
    assert by_topic(tmp_path / "with") == by_topic(tmp_path / "without")
