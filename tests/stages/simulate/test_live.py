"""A drive that is published while it is recorded."""

import re
import time
from pathlib import Path

import pytest
from dds_process import dds_subscriber, new_domain

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.live.stream import FIND_S, LiveStream
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

SETTINGS = (
    *("simulation.duration_s=1", "simulation.warmup_s=1", "v2x.enabled=false"),
    *("sensors.lidars.lidar.channels=8", "sensors.lidars.lidar.points_per_second=14400"),
)
WORDS, OTHERS = Topic("/words", "std_msgs/msg/String"), Topic("/others", "std_msgs/msg/String")


@pytest.mark.oracle
def test_another_process_receives_the_drive_that_the_bag_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bag has the same bytes as without."""
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    scenario = load_scenario("smoke", SETTINGS)
    with dds_subscriber(
        domain, ("rt/ego/lidar/points", "cloud", "reliable"), ("rt/scenario/info", "string", "latched")
    ) as seen:
        simulate(scenario, tmp_path / "live", live="ros2")
        samples, _ = seen()
    simulate(scenario, tmp_path / "alone")
    recorded = tmp_path / "live" / "clean" / "clean_0.mcap"
    assert recorded.read_bytes() == (tmp_path / "alone" / "clean" / "clean_0.mcap").read_bytes()
    reader = BagReader(recorded)
    clouds = [one for one in samples if one["topic"] == "rt/ego/lidar/points"]
    stamps_ns = reader.log_times_ns("/ego/lidar/points").tolist()
    assert [one["stamp_ns"] for one in clouds] == stamps_ns
    (info,) = [one["data"] for one in samples if one["topic"] == "rt/scenario/info"]
    assert [info] == [message.data for _, message in reader.messages("/scenario/info")]
    count = sum(topic.count for topic in reader.topics.values())
    assert f"published {count} messages to ROS 2 domain {domain}, " in capsys.readouterr().err


@pytest.mark.oracle
@pytest.mark.nightly
def test_a_slow_subscriber_is_one_line_and_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    scenario = load_scenario("smoke", (*SETTINGS, "simulation.duration_s=8"))
    with dds_subscriber(domain, ("rt/ego/lidar/points", "cloud", "reliable"), slow_s=90):
        simulate(scenario, tmp_path / "live", live="ros2")
    said = capsys.readouterr().err.splitlines()
    (line,) = [line for line in said if "too slow" in line]
    assert line.startswith("/ego/lidar/points: a reliable subscriber is too slow, or gone: ")
    assert re.search(r"; slow subscribers missed at least \d\d messages$", said[-1])


class Noting:
    """Notes when it got which message; it does not know the type of /others."""

    def __init__(self) -> None:
        self.got: list[tuple[float, str, int]] = []

    def advertise(self, published: PublishedTopic) -> None:
        if published.topic == OTHERS:
            raise UnpublishableTypeError("/others cannot be published")

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        self.got.append((time.monotonic(), topic_name, time_ns))
        return True

    def close(self) -> None: ...


def step(time_s: float, topic: Topic = WORDS) -> list[StampedCdr]:
    return [(topic, b"", round(time_s * 1e9))]


def test_at_most_in_real_time(capsys: pytest.CaptureFixture[str]) -> None:
    """A late step is not caught up by the next ones; a type that cannot be published is left out, once."""
    noting = Noting()
    stream = LiveStream(noting)
    for time_s in (0.0, 0.1, 0.2):
        stream.publish(step(time_s))
    time.sleep(0.5)
    for time_s in (0.3, 0.4):
        stream.publish(step(time_s))
    stream.publish(step(0.4, OTHERS))
    stream.publish(step(0.4, OTHERS))
    stream.publish([])
    at_s = [at for at, _, _ in noting.got]
    assert len(at_s) == stream.messages == 5
    assert at_s[2] - at_s[1] > 0.099
    assert at_s[4] - at_s[3] > 0.099
    assert stream.behind_s > 0.39
    assert capsys.readouterr().err == "/others cannot be published; it is left out\n"


def test_subscribers_have_time_to_find_a_topic() -> None:
    stream = LiveStream(Noting())
    begin_s = time.monotonic()
    stream.publish(step(0.0))
    assert time.monotonic() - begin_s > FIND_S


def test_an_unknown_publisher(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"unknown publisher 'ros3'; did you mean 'ros2'\? known: ros2, fox"):
        simulate(load_scenario("smoke", SETTINGS), tmp_path / "drive", live="ros3")
    assert not list(tmp_path.iterdir())
