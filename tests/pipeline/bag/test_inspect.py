import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import Topic

Record = Callable[..., Path]


def test_what_is_in_a_bag(tmp_path: Path, record: Record, capsys: pytest.CaptureFixture[str]) -> None:
    record(tmp_path / "town" / "clean", frames=5)
    description = describe(tmp_path / "town")
    topics = {topic.name: topic for topic in description.topics}
    assert topics["/ego/lidar/points"].rate_hz == pytest.approx(10)
    assert topics["/tf_static"].rate_hz == 0
    assert topics["/tf_static"].qos == "reliable latched 1"
    assert description.duration_s == pytest.approx(0.4)
    assert description.messages == 42
    assert (description.clouds, description.points_least, description.points_most) == (5, 200, 200)
    ((car),) = description.objects
    assert (car.class_name, car.boxes, car.road_users) == ("car", 5, 1)
    assert description.bytes == (tmp_path / "town/clean/clean_0.mcap").stat().st_size
    assert description.provenance["seed"] == "7"
    assert json.loads(description.to_json())["messages"] == 42
    description.print()
    printed = capsys.readouterr().out
    assert "1 road user, 5 boxes" in printed
    assert "valid; they cover 1 of 1 chunks, 1 of 1 data sections" in printed


def test_checksums_that_are_missing_are_reported(tmp_path: Path, record_foreign: Record) -> None:
    assert "damage would go unnoticed" in str(describe(record_foreign(tmp_path / "foreign")).checksums)


def test_damage_between_the_chunks_is_found(tmp_path: Path, record: Record) -> None:
    """The data section's checksum also covers what reading messages never looks at."""
    path = record(tmp_path / "bag", frames=1) / "bag_0.mcap"
    changed = bytearray(path.read_bytes())
    place = changed.index(b"serialized_metadata") + 200
    changed[place] ^= 1
    path.write_bytes(changed)
    with pytest.raises(AdvpipeError, match=r"bag_0\.mcap: damaged"):
        describe(tmp_path / "bag")


def test_several_lidars_on_several_vehicles(
    tmp_path: Path, record_fleet: Record, capsys: pytest.CaptureFixture[str]
) -> None:
    description = describe(record_fleet(tmp_path / "fleet"))
    counts = {topic.name: topic.count for topic in description.topics}
    assert [counts[f"/{name}/points"] for name in ("ego/lidar", "ego/roof", "bus_3/front")] == [2, 2, 2]
    assert (description.clouds, description.points_least, description.points_most) == (6, 1, 3)
    assert [(item.class_name, item.road_users, item.boxes) for item in description.objects] == [
        ("car", 1, 2),
        ("truck", 1, 2),
    ]
    assert [(one.topic, one.clouds, one.points_least, one.points_mean) for one in description.lidars] == [
        ("/bus_3/front/points", 2, 3, 3.0),
        ("/ego/lidar/points", 2, 1, 1.0),
        ("/ego/roof/points", 2, 2, 2.0),
    ]
    description.print()
    shown = capsys.readouterr().out
    assert re.search(r"clouds of /bus_3/front/points +2 of 3 to 3 points, 3 on average", shown)


def test_what_others_claimed_to_a_vehicle_is_no_truth(tmp_path: Path, record: Record) -> None:
    """The LDM's boxes have the type of the ground truth."""
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        for raw in BagReader(record(tmp_path / "original", frames=2)).raw_messages():
            bag.copy(raw)
            if raw.topic.name == "/ego/ground_truth/objects":
                bag.write_cdr(Topic("/ego/ldm/objects", raw.topic.type), raw.cdr, raw.log_time_ns)
    ((car),) = describe(tmp_path / "bag").objects
    assert car.boxes == 2
