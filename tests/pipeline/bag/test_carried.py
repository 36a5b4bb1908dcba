"""Which topics are LiDARs', by the scenario in the bag; whatever it says, errors are one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.carried import lidar_topics, sensors_by_topic
from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import FrameSlice, window_of
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics

FRONT, ROOF = (VehicleTopics("ego", name).lidar_points for name in ("front", "roof"))
SCENARIO = {
    "vehicles": {"ego": {}},
    "sensors": {"lidars": {"roof": {"vehicle": "ego"}}, "sonars": {"front": {}}, "gnss": {}, "v3x": {}},
}

Record = Callable[[object], BagReader]


@pytest.fixture
def record(tmp_path: Path) -> Record:
    """A bag with one cloud of 3 points on `front`, one of 5 on `roof`, and this scenario."""

    def record(scenario: object) -> BagReader:
        text = scenario if isinstance(scenario, str) else json.dumps(scenario)
        with BagWriter(tmp_path / "bag", provenance={}) as bag:
            bag.write(SCENARIO_INFO, build.string(text), 0)
            for topic, points in ((FRONT, 3), (ROOF, 5)):
                bag.write_cdr(topic, cloud_to_cdr(np.zeros(points, POINT_DTYPE), 0, "a"), 0)
        return BagReader(tmp_path / "bag")

    return record


def test_what_the_scenario_names_is_a_lidar(record: Record) -> None:
    reader = record(SCENARIO)
    assert lidar_topics(reader) == [ROOF.name]
    assert find_lidar_topic(reader) == ROOF.name
    assert (describe(reader.path).clouds, describe(reader.path).points_mean) == (1, 5)
    known = sensors_by_topic(reader)
    assert known is not None
    assert {name: (one.key, one.vehicle, one.name) for name, one in known.items()} == {
        ROOF.name: ("lidars", "ego", "roof"),
        "/ego/gnss/fix": ("gnss", "ego", ""),
    }


def test_clouds_that_no_sensor_made_may_be_named(record: Record) -> None:
    """Such as those that a user has worked on and added to a bag of ours."""
    assert find_lidar_topic(record(SCENARIO), FRONT.name) == FRONT.name


def test_a_drive_without_lidars_has_no_clouds_of_theirs(record: Record) -> None:
    reader = record({"sensors": {"lidars": {}}})
    assert lidar_topics(reader) == []
    with pytest.raises(
        UsageError, match=f"no LiDAR clouds .the point clouds of {FRONT.name}, {ROOF.name} are"
    ):
        find_lidar_topic(reader)
    with pytest.raises(UsageError, match="holds no LiDAR clouds, so the frames 0:1:1 select no time span"):
        window_of(reader, FrameSlice(0, 1))


@pytest.mark.parametrize("scenario", [{}, {"sensors": None}, {"name": "theirs"}])
def test_without_sensors_in_the_scenario_every_cloud_may_be_one(record: Record, scenario: object) -> None:
    reader = record(scenario)
    assert lidar_topics(reader) == [FRONT.name, ROOF.name]
    with pytest.raises(
        UsageError, match="has several LiDAR topics and none is /ego/lidar/points; name one by lidar"
    ):
        find_lidar_topic(reader)


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ("{", "holds no scenario: not valid JSON"),
        ([], "holds no scenario: "),
        ({"sensors": 5}, "holds no scenario: sensors: "),
        ({"sensors": {"lidars": 5}}, "holds no scenario: sensors.lidars: "),
        ({"sensors": {"lidars": {"a": 5}}}, "holds no scenario: sensors.lidars: a: "),
        ({"sensors": {"lidars": {"A b": {}}}}, "holds no scenario: sensors.lidars: A b"),
        ({"sensors": {"lidars": {"a": {"vehicle": "../x"}}}}, "holds no scenario: sensors.lidars: a.vehicle"),
    ],
)
def test_what_is_no_scenario_is_reported_in_a_line(record: Record, scenario: object, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        find_lidar_topic(record(scenario))
    assert "\n" not in str(caught.value)
