"""What of a bag is played, and in which order."""

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.build import clock, string
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import message_class
from advpipe.stages.play.options import PlayOptions
from advpipe.stages.play.timeline import Timeline, clock_message

BEGIN_NS = 1_000_000_000_000
WORDS = Topic("/words", "std_msgs/msg/String")
LATCHED = Topic("/latched", "std_msgs/msg/String", keep_last(2, latched=True))


def write(path: Path, *, with_clock: bool) -> Path:
    """A second with four latched messages, ten words, and ten ticks."""
    with BagWriter(path, provenance={"kind": "clean"}) as writer:
        for number in range(4):
            writer.write(LATCHED, string(f"latched {number}"), BEGIN_NS + number * 1000)
        for tenth in range(10):
            stamp_ns = BEGIN_NS + tenth * 100_000_000
            if with_clock:
                writer.write(CLOCK, clock(stamp_ns), stamp_ns)
            writer.write(WORDS, string(f"word {tenth}"), stamp_ns + 10_000)
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("bag") / "bag", with_clock=True)


def timeline(bag: Path, **options: object) -> Timeline:
    return Timeline(BagReader(bag), PlayOptions(ros2=True, **options))  # type: ignore[arg-type]


def names(found: Timeline) -> list[str]:
    return sorted(one.topic.name for one in found.published)


def texts(bag: Path, raws: object) -> list[str]:
    reader = BagReader(bag)
    return [
        getattr(reader.decode(raw), "data", "tick")
        for raw in raws  # type: ignore[attr-defined]
    ]


def test_the_whole_bag(bag: Path) -> None:
    found = timeline(bag)
    assert names(found) == ["/clock", "/latched", "/words"]
    assert found.begin_ns == BEGIN_NS
    assert list(found.latched_before()) == []
    assert [raw.cdr for raw in found.messages()] == [raw.cdr for raw in BagReader(bag).raw_messages()]


def test_a_later_start_has_what_latched_topics_keep(bag: Path) -> None:
    found = timeline(bag, start_s=0.75)
    assert texts(bag, found.latched_before()) == ["latched 2", "latched 3"]
    assert texts(bag, found.messages()) == ["tick", "word 8", "tick", "word 9"]


def test_chosen_topics_come_with_the_clock(bag: Path) -> None:
    found = timeline(bag, topics=("/wo*",))
    assert names(found) == ["/clock", "/words"]
    assert set(texts(bag, found.messages())) == {"tick", *(f"word {n}" for n in range(10))}
    assert names(timeline(bag, topics=("/wo*",), clock_hz=0.0)) == ["/words"]


@pytest.mark.parametrize(("options", "hz"), [({"clock_hz": 20.0}, 20), ({}, 40)])
def test_a_clock_of_its_own(tmp_path: Path, options: dict[str, object], hz: int) -> None:
    """Where it is asked for, or the bag has none: at even times, in between the messages."""
    bag = write(tmp_path / "bag", with_clock="clock_hz" in options)
    raws = list(timeline(bag, **options).messages())
    times_ns = [raw.log_time_ns for raw in raws]
    assert times_ns == sorted(times_ns)
    ticks = [raw for raw in raws if raw.topic == CLOCK]
    period_ns = 10**9 // hz
    assert [raw.log_time_ns for raw in ticks] == list(range(BEGIN_NS, times_ns[-1] + 1, period_ns))
    last = BagReader(bag).decode(ticks[-1])
    assert last == message_class(CLOCK.type)(clock=last.clock)
    assert last.clock.sec * 10**9 + last.clock.nanosec == ticks[-1].log_time_ns


def test_a_clock_beyond_the_time_of_ros_2() -> None:
    with pytest.raises(AdvpipeError, match="ROS 2's time ends in 2038; leave it out with clock_hz=0"):
        clock_message(2**31 * 10**9)


def test_a_topic_is_left_out(bag: Path) -> None:
    found = timeline(bag)
    found.leave_out("/latched")
    assert names(found) == ["/clock", "/words"]
    assert "latched 0" not in texts(bag, found.messages())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"topics": ("/wrods",)}, r"has no topic /wrods; did you mean '/words'\?"),
        ({"start_s": 60.0}, "nothing is left to play; it has 0.9 s, choose a smaller start"),
    ],
)
def test_nothing_to_play(bag: Path, options: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        timeline(bag, **options)
