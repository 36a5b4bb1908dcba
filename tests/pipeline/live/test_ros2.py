"""Publishing by DDS, as another process with types of its own receives it."""

import hashlib
import resource
import time
from pathlib import Path

import pytest
from dds_process import dds_subscriber, new_domain
from rosbags.highlevel import AnyReader

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import schema_text, serialise, type_hash

pytest.importorskip("cyclonedds")

from advpipe.pipeline.live.acknowledgements import PATIENCE_S
from advpipe.pipeline.live.dds_domain import domain_configuration, domain_id_of_environment
from advpipe.pipeline.live.ros2 import Ros2Publisher, dds_topic_name
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.writer_qos import BLOCK_S

SAMPLE = shipped_sample() / "clean"
NAMES = ("/clock", "/scenario/info", "/ego/lidar/points")


@pytest.fixture
def domain() -> int:
    return new_domain()


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def wait_for_subscribers(publisher: Ros2Publisher, *names: str) -> None:
    end_s = time.monotonic() + 30
    while not all(publisher.subscribers(name) for name in names):
        assert time.monotonic() < end_s, "no subscriber"
        time.sleep(0.02)


@pytest.mark.oracle
def test_another_process_receives_what_rosbags_reads(domain: int) -> None:
    """Types, QoS and hashes are those that it finds on the network, and latched topics wait for it."""
    raws = list(BagReader(SAMPLE).raw_messages(NAMES))
    publisher = Ros2Publisher(Ros2Node(domain, "lo"))
    for raw in {raw.topic.name: raw for raw in raws}.values():
        publisher.advertise(PublishedTopic(raw.topic, raw.schema))
    latched = [raw for raw in raws if raw.topic.name == "/scenario/info"]
    assert all(publisher.publish(raw.topic.name, raw.cdr, raw.log_time_ns) for raw in latched)
    topics = [
        ("rt/clock", "clock", "best_effort"),
        ("rt/scenario/info", "string", "latched"),
        ("rt/ego/lidar/points", "cloud", "reliable"),
    ]
    with dds_subscriber(domain, *topics) as seen:
        wait_for_subscribers(publisher, *NAMES)
        for raw in raws:
            if raw not in latched:
                assert publisher.publish(raw.topic.name, raw.cdr, raw.log_time_ns)
                time.sleep(0.02)
        samples, publications = seen()
    publisher.close()
    by_topic = {topic: [one for one in samples if one["topic"] == topic] for topic, _, _ in topics}
    with AnyReader([SAMPLE]) as reader:
        expected = [reader.deserialize(raw.cdr, raw.topic.type) for raw in raws]
    clouds = [message for message in expected if hasattr(message, "width")]
    assert [one["sha256"] for one in by_topic["rt/ego/lidar/points"]] == [
        hashlib.sha256(cloud.data.tobytes()).hexdigest() for cloud in clouds
    ]
    assert [one["width"] for one in by_topic["rt/ego/lidar/points"]] == [cloud.width for cloud in clouds]
    assert [one["data"] for one in by_topic["rt/scenario/info"]] == [
        message.data for message in expected if hasattr(message, "data") and not hasattr(message, "width")
    ]
    assert [one["stamp_ns"] for one in by_topic["rt/clock"]] == [
        message.clock.sec * 10**9 + message.clock.nanosec for message in expected if hasattr(message, "clock")
    ]
    cloud = publications["rt/ego/lidar/points"]
    assert cloud["type"] == "sensor_msgs::msg::dds_::PointCloud2_"
    assert cloud["user_data"] == f"typehash={type_hash('sensor_msgs/msg/PointCloud2')};"
    assert "Policy.History.KeepLast(depth=5)" in cloud["qos"]
    assert f"Policy.Reliability.Reliable(max_blocking_time={round(BLOCK_S * 1e9)})" in cloud["qos"]
    assert "Policy.Reliability.BestEffort" in publications["rt/clock"]["qos"]
    assert "Policy.Durability.TransientLocal" in publications["rt/scenario/info"]["qos"]


@pytest.mark.oracle
def test_a_subscriber_that_takes_nothing_costs_neither_time_nor_memory(
    domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """185 MB of clouds, of which the topic's history keeps five; what it misses is counted, and said once."""
    (raw, *_) = BagReader(SAMPLE).raw_messages(["/ego/lidar/points"])
    publisher = Ros2Publisher(Ros2Node(domain, "lo"))
    publisher.advertise(PublishedTopic(raw.topic, raw.schema))
    with dds_subscriber(domain, ("rt/ego/lidar/points", "cloud", "reliable"), slow_s=60):
        wait_for_subscribers(publisher, raw.topic.name)
        before_mb, begin_s = resident_mb(), time.monotonic()
        for _ in range(400):
            publisher.publish(raw.topic.name, raw.cdr, 0)
        assert resident_mb() - before_mb < 60
        assert time.monotonic() - begin_s < 400 * BLOCK_S
        time.sleep(PATIENCE_S + 1)
        for _ in range(30):
            publisher.publish(raw.topic.name, raw.cdr, 0)
            time.sleep(0.1)
        begin_s = time.monotonic()
        publisher.close()
        assert time.monotonic() - begin_s < 10
    missed = publisher.missed().messages
    assert list(missed) == [raw.topic.name]
    assert 10 < missed[raw.topic.name] <= 430
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        f"{raw.topic.name}: a reliable subscriber is too slow, or gone: it has acknowledged"
    )


@pytest.mark.oracle
def test_nothing_is_missed_by_quick_subscribers_of_quick_topics(
    domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Acknowledgements of small messages come late, and always for some of them alone."""
    publisher = Ros2Publisher(Ros2Node(domain, "lo"))
    words = Topic("/words", "std_msgs/msg/String", keep_last(2))
    publisher.advertise(PublishedTopic(words, schema_text(words.type)))
    with dds_subscriber(domain, ("rt/words", "string", "reliable")) as seen:
        wait_for_subscribers(publisher, "/words")
        time.sleep(1)  # the other end has to find the publisher, too
        for number in range(600):
            publisher.publish("/words", serialise(string(str(number)), words.type), 0)
            time.sleep(0.005)
        publisher.close()
        samples, _ = seen()
    assert len(samples) == 600
    assert publisher.missed().messages == {}
    assert capsys.readouterr().err == ""


@pytest.mark.oracle
def test_bytes_that_are_not_of_the_type(domain: int) -> None:
    publisher = Ros2Publisher(Ros2Node(domain, "lo"))
    string = Topic("/words", "std_msgs/msg/String")
    publisher.advertise(PublishedTopic(string, schema_text(string.type)))
    with pytest.raises(AdvpipeError, match=r"^a message of /words at 7 ns is not a valid std_msgs"):
        publisher.publish("/words", b"\0\1\0\0\xff\xff\0\0abc\0", 7)
    publisher.close()


@pytest.mark.oracle
def test_a_name_that_dds_refuses(domain: int) -> None:
    publisher = Ros2Publisher(Ros2Node(domain, "lo"))
    topic = Topic("/two words", "std_msgs/msg/String")
    with pytest.raises(UnpublishableTypeError, match=r"^/two words cannot be published to ROS 2: DDS"):
        publisher.advertise(PublishedTopic(topic, schema_text(topic.type)))
    publisher.close()


def test_names() -> None:
    assert dds_topic_name(CLOCK) == "rt/clock"


def test_the_environment_of_ros_2(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CYCLONEDDS_URI", "ROS_LOCALHOST_ONLY", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)
    assert domain_id_of_environment() == 0
    assert "lo" not in domain_configuration(None).split('"')
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert 'name="lo"' in domain_configuration(None)
    monkeypatch.setenv("CYCLONEDDS_URI", "file:///etc/cyclone.xml")
    assert domain_configuration(None) == "file:///etc/cyclone.xml"
    assert 'name="lo"' in domain_configuration("lo")
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert domain_id_of_environment() == 42
    monkeypatch.setenv("ROS_DOMAIN_ID", "233")
    with pytest.raises(UsageError, match="from 0 to 232"):
        domain_id_of_environment()


def test_an_interface_that_is_not_there(domain: int) -> None:
    with pytest.raises(UsageError, match=r"no network interface loo; did you mean 'lo'\?"):
        Ros2Node(domain, "loo")


@pytest.mark.oracle
def test_the_own_configuration_of_cyclone_is_read(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><Nonsense/></Domain></CycloneDDS>")
    with pytest.raises(
        AdvpipeError, match=f"^DDS domain {domain} cannot be joined .*CYCLONEDDS_URI"
    ) as found:
        Ros2Node(domain)
    assert "\n" not in str(found.value)
