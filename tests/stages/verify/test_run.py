"""Verify: all that was really made is good, and each thing that is spoilt is found by its own check."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from found_checks import checks_of
from rosbags.rosbag2 import StoragePlugin, Writer

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import cloud_from_cdr, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise, typestore
from advpipe.stages.verify.run import verify

EGO = VehicleTopics("ego")
CLOUD = EGO.lidar_points.name
Messages = Iterable[RawMessage]
Rewrite = Callable[[Path, Callable[[Messages], Messages]], None]


def changed(topic: str, change: Callable[[RawMessage], RawMessage | None], number: int = 1) -> object:
    """An edit of the topic's message with this number."""

    def edit(stream: Messages) -> Iterator[RawMessage]:
        seen = 0
        for raw in stream:
            seen += raw.topic.name == topic
            if raw.topic.name != topic or seen != number + 1:
                yield raw
            elif (new := change(raw)) is not None:
                yield new

    return edit


def decoded(change: Callable[..., object]) -> Callable[[RawMessage], RawMessage]:
    """Changes a message's values in place."""

    def edit(raw: RawMessage) -> RawMessage:
        message = typestore().deserialize_cdr(raw.cdr, raw.topic.type)
        change(message)
        return replace(raw, cdr=serialise(message, raw.topic.type))

    return edit


def one_point_more(message: object) -> None:
    message.road_users[0].lidar_points += 1  # type: ignore[attr-defined]


def an_earlier_stamp(message: object) -> None:
    message.header.stamp.sec -= 1  # type: ignore[attr-defined]


def another_parent(message: object) -> None:
    message.transforms[0].header.frame_id = "moon"  # type: ignore[attr-defined]


def another_message(message: object) -> None:
    message.number += 1  # type: ignore[attr-defined]


def another_sender(message: object) -> None:
    message.station_id ^= 1  # type: ignore[attr-defined]


def another_byte(message: object) -> None:
    message.data = message.data ^ 1  # type: ignore[attr-defined]


def out_of_order(stream: Messages) -> Iterator[RawMessage]:
    """Two ticks of the clock change places in the file."""
    held: list[RawMessage] = []
    for raw in stream:
        if raw.topic.name == "/clock" and len(held) < 2:
            held.append(raw)
            if len(held) == 2:
                yield from reversed(held)
        else:
            yield raw


def other_qos(stream: Messages) -> Iterator[RawMessage]:
    lax = Topic("/clock", "x").qos
    for raw in stream:
        yield replace(raw, topic=replace(raw.topic, qos=lax)) if raw.topic.name == "/clock" else raw


def all_but(*topics: str) -> Callable[[Messages], Iterator[RawMessage]]:
    return lambda stream: (raw for raw in stream if raw.topic.name not in topics)


def test_generated_data_sets_have_no_findings(data_set: Path) -> None:
    """Every attack on every sensor, in full."""
    result = verify(data_set)
    assert result.findings == []
    assert {gap.check for gap in result.unchecked} == {"checksums", "cams", "fixes"}
    assert verify(data_set, quick=True).is_good


@pytest.mark.parametrize(
    ("check", "edit"),
    [
        ("rates", changed("/clock", lambda raw: None)),
        ("rates", changed(EGO.imu.name, lambda raw: None)),
        ("time", out_of_order),
        ("time", changed(EGO.gnss_fix.name, decoded(an_earlier_stamp))),
        ("types", changed("/clock", lambda raw: replace(raw, cdr=raw.cdr[:-1]))),
        ("types", lambda stream: (replace(raw, schema=f"{raw.schema}\n# so") for raw in stream)),
        ("qos", other_qos),
        ("transforms", changed("/tf", decoded(another_parent))),
        ("transforms", all_but("/tf_static")),
        ("boxes", changed(EGO.road_users.name, decoded(one_point_more))),
        ("receptions", changed(EGO.true_receptions.name, decoded(another_message))),
        ("receptions", changed(EGO.true_receptions.name, decoded(another_sender))),
        ("receptions", changed(EGO.true_receptions.name, lambda raw: None)),
        ("receptions", changed(EGO.reception_info.name, lambda raw: None)),
        ("receptions", changed(EGO.received_raw.name, decoded(another_byte))),
        ("receptions", all_but("/v2x/sent")),
    ],
)
def test_faults_in_a_clean_bag_are_found(data_set: Path, rewrite: Rewrite, check: str, edit: object) -> None:
    """Each bag is whole in itself. (The rate of a topic is off by one message in 20, or in 200.)"""
    rewrite(data_set / "clean", edit)  # type: ignore[arg-type]
    found = checks_of(data_set / "clean")
    assert check in found
    assert found <= {check, "boxes", "rates"}


def moved(raw: RawMessage) -> RawMessage:
    stamp_ns, frame_id, cloud = cloud_from_cdr(raw.cdr)
    cloud = cloud.copy()
    cloud["x"][3] += 0.25
    return replace(raw, cdr=cloud_to_cdr(cloud, stamp_ns, frame_id))


def lighter(message: object) -> None:
    message.payload = message.payload[:-1]  # type: ignore[attr-defined]


def north(message: object) -> None:
    message.latitude += 1e-7  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("bag", "check", "edit"),
    [
        ("detach", "points", changed(CLOUD, moved)),
        ("perturb", "points", changed(CLOUD, moved)),
        ("attach", "points", changed(CLOUD, moved)),
        ("detach", "points", changed(CLOUD, lambda raw: None)),
        ("detach", "copies", changed(EGO.gnss_fix.name, decoded(north))),
        ("detach", "copies", changed("/clock", lambda raw: None)),
        ("gnss", "copies", changed(CLOUD, moved)),
        ("gnss", "fixes", changed(EGO.gnss_fix.name, decoded(north))),
        ("cam", "cams", changed("/v2x/sent", decoded(lighter))),
        ("cam", "cams", changed("/v2x/sent", lambda raw: None)),
        ("delay", "cams", changed("/v2x/sent", lambda raw: None)),
        ("dos", "cams", changed("/v2x/sent", decoded(lighter), number=5)),
        ("cam", "receptions", changed(EGO.true_receptions.name, decoded(another_message))),
        ("gnss", "receptions", changed(EGO.true_receptions.name, decoded(another_sender))),
        ("detach", "copies", changed(EGO.true_receptions.name, decoded(another_sender))),
    ],
)
def test_attacks_beyond_their_provenance_are_found(
    data_set: Path, rewrite: Rewrite, bag: str, check: str, edit: object
) -> None:
    for other in data_set.iterdir():
        if other.is_dir() and other.name not in ("clean", bag):
            shutil.rmtree(other)
    rewrite(data_set / bag, edit)  # type: ignore[arg-type]
    found = checks_of(data_set)
    assert check in found
    of_receivers = {"receptions"} if check == "cams" else set()  # who received it has the other bytes
    assert found <= {check, "time", "types"} | of_receivers


@pytest.mark.parametrize("spoil", ["moved farther", "frame", "left out"])
def test_wrong_labels_are_found(data_set: Path, spoil: str) -> None:
    path = data_set / "perturb" / "labels.parquet"
    table = pq.read_table(path)
    if spoil == "left out":
        table = table.slice(1)
    else:
        name = {"moved farther": "displacement_m", "frame": "frame"}[spoil]
        column = table[name].to_numpy().copy()
        column[7] += 1
        index = table.column_names.index(name)
        table = table.set_column(index, table.schema.field(name), pa.array(column, table[name].type))
    pq.write_table(table, path)
    assert checks_of(data_set) - {"debug"} == {"beside", "points"}


def test_a_drive_without_recorded_receptions_is_unchecked(data_set: Path, rewrite: Rewrite) -> None:
    """It has no findings, and the missing receptions are reported as unchecked."""
    rewrite(data_set / "clean", all_but(EGO.true_receptions.name, EGO.reception_info.name))
    result = verify(data_set / "clean")
    assert result.findings == []
    (gap,) = (gap for gap in result.unchecked if gap.check == "receptions")
    assert "does not record which sent messages were received" in gap.what


def test_inconsistent_files_are_found(data_set: Path) -> None:
    """In each, one sign is another one."""
    for name, check in (
        ("scenario.yaml", "scenario"),
        ("clean/metadata.yaml", "metadata"),
        ("detach/attack.yaml", "beside"),
        ("gnss/metadata.yaml", "metadata"),
    ):
        path = data_set / name
        text = path.read_text()
        path.write_text(text.replace("1", "2", 1))
        assert checks_of(data_set) >= {check}, name
        path.write_text(text)


def test_a_bag_with_another_parent_is_a_fault(data_set: Path, rewrite: Rewrite) -> None:
    rewrite(data_set / "clean", lambda stream: (replace(raw, sequence=raw.sequence + 1) for raw in stream))
    found = verify(data_set).findings
    assert {finding.check for finding in found} == {"provenance"}
    assert len(found) == 7


def test_the_current_folder_is_verified(data_set: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(data_set)
    result = verify(Path(), quick=True)
    assert result.is_good
    assert result.path == str(data_set)


def test_a_single_adversarial_bag_is_verified_alone(data_set: Path, tmp_path: Path) -> None:
    alone = shutil.move(data_set / "detach", tmp_path / "alone")
    result = verify(Path(alone))
    assert result.is_good
    assert "verified alone" in " ".join(map(str, result.unchecked))


def test_an_attack_in_its_data_set_finds_its_parent(data_set: Path) -> None:
    result = verify(data_set / "detach")
    assert result.is_good
    assert "verified alone" not in " ".join(map(str, result.unchecked))


def test_leftovers_of_killed_runs_are_unchecked(data_set: Path) -> None:
    job = data_set / ".detach.0123456789ab.job"
    job.mkdir()
    (job / ".lock").touch()
    result = verify(data_set)
    assert result.is_good
    unchecked_text = ".detach.0123456789ab.job: was left by a killed run; not part of the data set"
    assert unchecked_text in " ".join(map(str, result.unchecked))
    with pytest.raises(AdvpipeError, match="unfinished run"):
        verify(job)


def test_paths_that_are_not_data_sets_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("x")
    for path, expected in (
        ("nothing", "does not exist"),
        ("", "neither a data set"),
        ("a.txt", "not a data set"),
    ):
        with pytest.raises(AdvpipeError, match=expected):
            verify(tmp_path / path)


def test_another_tools_bag_is_verified(tmp_path: Path) -> None:
    """rosbags writes no checksums, and no provenance: everything checkable is checked, the rest reported."""
    store = typestore()
    with Writer(tmp_path / "b", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        clock = writer.add_connection("/clock", "rosgraph_msgs/msg/Clock", typestore=store)
        for stamp_ns in range(0, 100, 10):
            writer.write(clock, stamp_ns, serialise(build.clock(stamp_ns), "rosgraph_msgs/msg/Clock"))
    result = verify(tmp_path / "b")
    assert result.findings == []
    unchecked_text = " ".join(map(str, result.unchecked))
    assert "does not record its origin" in unchecked_text
    assert "none in the bag" in unchecked_text
    metadata = tmp_path / "b" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("message_count: 10", "message_count: 11"))
    assert checks_of(tmp_path / "b") == {"metadata"}


def test_a_long_chain_of_frames_is_checked_quickly(data_set: Path, rewrite: Rewrite) -> None:
    """20,000 frames, each below the one before: looked at once."""

    def longer(message: object) -> None:
        transforms = message.transforms  # type: ignore[attr-defined]
        for number in range(20_000):
            header = replace(transforms[0].header, frame_id=f"a{number}")
            transforms.append(replace(transforms[0], header=header, child_frame_id=f"a{number + 1}"))

    rewrite(data_set / "clean", changed("/tf_static", decoded(longer), number=0))
    start_s = time.process_time()
    (finding,) = verify(data_set / "clean").findings
    assert "has several roots: a0, map" in finding.what
    assert time.process_time() - start_s < 30


def test_control_characters_are_escaped_in_findings(data_set: Path, rewrite: Rewrite) -> None:
    def coloured(stream: Messages) -> Iterator[RawMessage]:
        for raw in stream:
            name = raw.topic.name.replace("/clock", "/\x1b[31mclock\n")
            yield replace(raw, cdr=b"", topic=replace(raw.topic, name=name))

    rewrite(data_set / "clean", coloured)
    lines = [str(finding) for finding in verify(data_set / "clean").findings]
    assert any("\\x1b[31mclock" in line for line in lines)
    assert all(line.isprintable() for line in lines)
