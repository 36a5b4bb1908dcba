import json
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.errors import AdvpipeError

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
    assert "1 road users, 5 boxes" in printed
    assert "valid; cover 1 of 1 chunks, 1 of 1 data sections" in printed


def test_checksums_that_are_missing_are_told(tmp_path: Path, record_foreign: Record) -> None:
    assert "damage would go unseen" in str(describe(record_foreign(tmp_path / "foreign")).checksums)


def test_damage_between_the_chunks_is_found(tmp_path: Path, record: Record) -> None:
    """The data section's checksum also covers what reading messages never looks at."""
    path = record(tmp_path / "bag", frames=1) / "bag_0.mcap"
    changed = bytearray(path.read_bytes())
    place = changed.index(b"serialized_metadata") + 200
    changed[place] ^= 1
    path.write_bytes(changed)
    with pytest.raises(AdvpipeError, match=r"bag_0\.mcap: damaged"):
        describe(tmp_path / "bag")
