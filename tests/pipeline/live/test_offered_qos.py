"""The QoS under which topics are published again."""

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from advpipe.pipeline.live.offered_qos import MOST_KEPT, OfferedQos, offered_qos
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.topics import CLOCK, TF_STATIC

(TEN,) = keep_last(10)


def offer(*profiles: Qos, name: str = "/topic") -> OfferedQos:
    return offered_qos(Topic(name, "std_msgs/msg/String", profiles))


def test_the_recorded_offer() -> None:
    assert offered_qos(CLOCK) == OfferedQos(depth=1, is_reliable=False, is_latched=False)
    assert offered_qos(TF_STATIC) == OfferedQos(depth=1, is_reliable=True, is_latched=True)


def test_publishers_that_differ() -> None:
    """Each subscriber of one of them is served: by the strongest of the offers."""
    best_effort = TEN._replace(reliability=QosReliability.BEST_EFFORT, deadline=QosTime(0, 200_000_000))
    latched = TEN._replace(durability=QosDurability.TRANSIENT_LOCAL, depth=3, deadline=QosTime(1, 0))
    manual = TEN._replace(liveliness=QosLiveliness.MANUAL_BY_TOPIC, liveliness_lease_duration=QosTime(2, 0))
    expected = OfferedQos(
        depth=10,
        is_reliable=True,
        is_latched=True,
        deadline_ns=200_000_000,
        liveliness=QosLiveliness.MANUAL_BY_TOPIC,
        lease_ns=2_000_000_000,
    )
    assert offer(best_effort, latched, manual) == expected


def test_a_bag_without_qos() -> None:
    assert offer() == OfferedQos(depth=10, is_reliable=True, is_latched=False)
    assert offer(name="/tf_static").is_latched


def test_memory_is_bounded() -> None:
    assert offer(TEN._replace(history=QosHistory.KEEP_ALL)).depth == MOST_KEPT
    assert offer(TEN._replace(depth=2**31)).depth == MOST_KEPT
    assert offer(TEN._replace(depth=0)).depth == 10


def test_unlimited_and_unset_durations() -> None:
    """As a lifespan, the longest counts; zero stands for one that is not set."""
    short = TEN._replace(lifespan=QosTime(0, 5))
    assert offer(short).lifespan_ns == 5
    assert offer(short, TEN).lifespan_ns is None
    assert offer(TEN._replace(deadline=QosTime(0, 0), lifespan=QosTime(0, 0))) == offer(TEN)
    assert offer(TEN._replace(deadline=QosTime(2**62, 2**62))) == offer(TEN)  # more than DDS can state
    unknown = TEN._replace(liveliness=QosLiveliness.UNKNOWN, reliability=QosReliability.SYSTEM_DEFAULT)
    assert offer(unknown) == offer(TEN)
