"""A drive with CPMs, and attacks on the objects in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.messages import FILE
from advpipe.pipeline.labels.perceived_objects import OBJECT_FILE, read_object_labels
from advpipe.pipeline.messages.heard_objects import heard_objects_of_message
from advpipe.pipeline.messages.topics import V2X_SENT, VehicleTopics
from advpipe.pipeline.messages.v2x import sent_of_message
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.cpm_tree import decode_cpm
from advpipe.pipeline.v2x.message_type import CPM, message_type_of
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.attack.v2x.change import V2xChange, forge
from advpipe.stages.evaluate.cooperative.collective import collective_drive, collective_sections
from advpipe.stages.verify.run import verify

SETTINGS = (
    *("v2x.cpm={}", "v2x.others.position_stddev_m=0"),
    *("traffic.vehicles=16", "simulation.duration_s=2"),
)


@pytest.fixture(scope="module")
def drive(recorded) -> BagReader:
    return recorded(*SETTINGS)


def forged(drive: BagReader, name: str, **parameters) -> V2xChange:
    everybody = [each for each in V2xDrive(drive).stations.values() if each != "ego"]
    keys = {"type": name, "attackers": {"vehicles": everybody}, "parameters": parameters}
    return forge(drive, [attack_spec(keys)], seed=1)


def cpms(change: V2xChange, drive: BagReader) -> list[tuple[Sent, Sent]]:
    """Each CPM before and after the attack."""
    pairs = []
    for step in V2xDrive(drive).steps():
        if step.end_ns is None:
            break
        after = {one.number: one for one in change.edited(step)}
        assert set(after) == {one.number for one in step.sent}
        pairs += [(one, after[one.number]) for one in step.sent if message_type_of(one.payload) is CPM]
        others = [one for one in step.sent if message_type_of(one.payload) is not CPM]
        assert [after[one.number] for one in others] == others
    return pairs


def test_heard_objects_are_where_road_users_are(drive: BagReader) -> None:
    topics = VehicleTopics("ego")
    users = {}
    for time_ns, message in drive.messages(topics.road_users.name):
        users[time_ns] = np.array(
            [[user.pose.position.x, user.pose.position.y] for user in message.road_users]
        )
    away_m = []
    for time_ns, message in drive.messages(topics.heard_objects.name):
        own = next(m for t, m in drive.messages(topics.true_odometry.name) if t == time_ns)
        at_m = np.array([own.pose.pose.position.x, own.pose.pose.position.y])
        for one in heard_objects_of_message(message):
            place_m = np.array(one.moved_m(time_ns))
            if np.hypot(*(place_m - at_m)) < 50:
                there_m = np.concatenate([users[time_ns], at_m[None]])
                away_m.append(np.hypot(*(there_m - place_m).T).min())
    assert len(away_m) > 30
    assert np.quantile(away_m, 0.95) < 1.2  # by the senders' headings, and 0.2 m of noise
    assert np.median(away_m) < 0.5


def test_the_drive_holds_cpms_of_each_station_and_counts_them(drive: BagReader) -> None:
    sent = [sent_of_message(message) for _, message in drive.messages(V2X_SENT.name)]
    found = [one for one in sent if message_type_of(one.payload) is CPM]
    assert {one.station_id for one in found} == {one.station_id for one in sent}
    assert all(decode_cpm(one.payload).station_id == one.station_id for one in found)
    assert drive.topics["/ego/v2x/rx/cpm"].count > 0


@pytest.mark.parametrize("place", ["ahead", "random"])
def test_a_ghost_is_added_and_nothing_else_changes(drive: BagReader, place: str) -> None:
    pairs = cpms(forged(drive, "cpm-ghost", place=place), drive)
    changed = [(old, new) for old, new in pairs if old != new]
    assert changed
    for old, new in changed:
        before, after = decode_cpm(old.payload), decode_cpm(new.payload)
        assert after.objects[:-1] == before.objects
        assert after.perceived == before.perceived + 1
        ghost = after.objects[-1]
        assert (ghost.label, ghost.east_mps, ghost.north_mps) == ("car", 0.0, 0.0)
        if place == "ahead":
            assert np.hypot(ghost.east_m, ghost.north_m) < 26
        else:
            assert np.hypot(ghost.east_m, ghost.north_m) < 60


def test_the_nearest_objects_are_removed(drive: BagReader) -> None:
    pairs = cpms(forged(drive, "cpm-remove", objects=2, within_m=30), drive)
    removed = 0
    for old, new in pairs:
        before, after = decode_cpm(old.payload).objects, decode_cpm(new.payload).objects
        gone = [one for one in before if one not in after]
        assert len(gone) <= 2
        assert [one for one in before if one in after] == list(after)
        removed += len(gone)
        for one in gone:
            assert np.hypot(one.east_m, one.north_m) < 36  # from the front; the distance is from the middle
    assert removed


@pytest.mark.parametrize("direction", ["constant", "random"])
def test_objects_are_moved_by_the_distance(drive: BagReader, direction: str) -> None:
    pairs = cpms(forged(drive, "cpm-shift", distance_m=7, direction=direction), drive)
    moved_m = [
        np.hypot(was.east_m - now.east_m, was.north_m - now.north_m)
        for old, new in pairs
        if old != new
        for was, now in zip(decode_cpm(old.payload).objects, decode_cpm(new.payload).objects, strict=True)
    ]
    assert moved_m
    assert moved_m == pytest.approx([7.0] * len(moved_m), abs=0.02)


def test_bad_parameters_are_refused(drive: BagReader) -> None:
    for name, keys, reason in (
        ("cpm-ghost", {"place": "behind"}, "place is 'behind'"),
        ("cpm-remove", {"objects": 0}, "objects is 0"),
        ("cpm-shift", {"distance_m": 0}, "moves nothing"),
    ):
        with pytest.raises(UsageError, match=reason):
            forged(drive, name, **keys)


def test_a_drive_without_cpms_is_refused(recorded) -> None:
    with pytest.raises(UsageError, match="of which the drive has none"):
        forged(recorded("simulation.duration_s=1", "traffic.vehicles=8"), "cpm-ghost")


def test_labels_tell_which_objects_are_false_and_the_bag_is_verified(
    drive: BagReader, tmp_path: Path
) -> None:
    data_set = drive.path.parent if drive.path.name == "clean" else drive.path.parents[1]
    everybody = [each for each in V2xDrive(drive).stations.values() if each != "ego"]
    ghost = attack_spec({"type": "cpm-ghost", "attackers": {"vehicles": everybody}, "victim": "ego"})
    out = data_set / "ghosts"
    attack(data_set / "clean", out, AttackRequest((ghost,), seed=1))
    labels = read_object_labels(out)
    assert {label.action for label in labels} == {"added"}
    numbers = {row["number"] for row in pq.read_table(out / FILE).to_pylist()}
    assert {label.number for label in labels} == numbers
    rows = pq.read_table(out / OBJECT_FILE).to_pylist()
    assert all(row["true_x_m"] is None and row["false_x_m"] is not None for row in rows)
    assert verify(data_set).is_good

    clean, attacked = (collective_drive(name, data_set / name, "ego").record for name in ("clean", "ghosts"))
    assert clean.heard_false < 0.02
    assert clean.attacked == 0
    assert attacked.attacked > 0
    assert attacked.heard_false > clean.heard_false
    assert clean.known_with_cpms >= clean.known_by_cams
    assert clean.free_space_fpr < 0.1
    (section,) = collective_sections(data_set / "clean", [out])
    (picture,) = section.pictures  # of the attacked bag
    assert (picture.bag, picture.is_worst) == ("ghosts", True)
    assert picture.png.startswith(b"\x89PNG")
