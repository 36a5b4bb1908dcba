"""Serving viewers: a plain WebSocket client that speaks Foxglove's protocol from its specification."""

import contextlib
import json
import re
import struct
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.build import clock, string
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import schema_text, serialise

pytest.importorskip("foxglove")

from advpipe.pipeline.live.foxglove_server import BACKLOG, FoxgloveServer

pytestmark = pytest.mark.oracle

LATCHED = Topic("/info", "std_msgs/msg/String", keep_last(2, latched=True))
WORDS = Topic("/words", "std_msgs/msg/String")
MESSAGE_DATA, TIME = 1, 2


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    with contextlib.closing(FoxgloveServer(0)) as found:
        for topic in (LATCHED, WORDS, CLOCK):
            found.advertise(PublishedTopic(topic, schema_text(topic.type)))
        yield found


class Viewer:
    """Subscribes to topics; `channels` are those that the server advertises."""

    def __init__(self, socket: ClientConnection, topics: int) -> None:
        self._socket = socket
        self.info = json.loads(socket.recv(timeout=20))
        self.channels: dict[str, dict[str, Any]] = {}
        while len(self.channels) < topics:
            said = json.loads(socket.recv(timeout=20))
            assert said["op"] == "advertise"
            self.channels |= {channel["topic"]: channel for channel in said["channels"]}

    def subscribe(self, *topics: str) -> None:
        self._ids = dict(enumerate(topics))
        wanted = [{"id": key, "channelId": self.channels[name]["id"]} for key, name in self._ids.items()]
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def next(self, timeout_s: float = 20) -> tuple[str, int, bytes]:
        """Topic, time and body of the next message; of the server's own time, the topic is empty."""
        said = self._socket.recv(timeout=timeout_s)
        assert isinstance(said, bytes)
        if said[0] == TIME:
            return "", struct.unpack_from("<Q", said, 1)[0], b""
        assert said[0] == MESSAGE_DATA
        key, time_ns = struct.unpack_from("<IQ", said, 1)
        return self._ids[key], time_ns, said[13:]


@contextlib.contextmanager
def viewer(server: FoxgloveServer, topics: int = 3) -> Iterator[Viewer]:
    with connect(server.url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:  # type: ignore[list-item]
        yield Viewer(socket, topics)


def words(text: str) -> bytes:
    return serialise(string(text), WORDS.type)


def test_channels_and_messages(server: FoxgloveServer) -> None:
    with viewer(server) as one:
        assert one.info["op"] == "serverInfo"
        assert "time" in one.info["capabilities"]
        channel = one.channels["/words"]
        assert channel["encoding"] == "cdr"
        assert channel["schemaName"] == "std_msgs/msg/String"
        assert channel["schemaEncoding"] == "ros2msg"
        assert channel["schema"] == schema_text("std_msgs/msg/String")
        server.publish("/info", words("kept"), 3)
        one.subscribe("/words", "/info", "/clock")
        assert one.next() == ("/info", 3, words("kept"))
        assert server.publish("/words", words("heard"), 5)
        assert one.next() == ("/words", 5, words("heard"))
        tick = serialise(clock(10**18), CLOCK.type)
        server.publish("/clock", tick, 10**18)
        assert {one.next(), one.next()} == {("/clock", 10**18, tick), ("", 10**18, b"")}


def test_a_step_of_many_messages_arrives_whole(server: FoxgloveServer) -> None:
    with viewer(server) as one:
        server.publish("/info", words("begin"), 0)  # before: what is kept comes once, on subscribing
        one.subscribe("/words", "/info")
        assert one.next()[0] == "/info"
        for number in range(200):
            server.publish("/words", words(str(number)), number)
        assert [one.next()[1] for _ in range(200)] == list(range(200))


def test_late_viewers_receive_what_latched_topics_keep(server: FoxgloveServer) -> None:
    for number in range(4):
        server.publish("/info", words(str(number)), number)
        server.publish("/words", words(str(number)), number)
    for _ in range(2):
        with viewer(server) as late:
            late.subscribe("/words", "/info")
            assert [late.next(), late.next()] == [("/info", 2, words("2")), ("/info", 3, words("3"))]
            with pytest.raises(TimeoutError):
                late.next(0.2)


def test_a_slow_viewer_misses_the_oldest_and_memory_is_bounded(
    server: FoxgloveServer, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not server.missed().uncounted
    (raw, *_) = BagReader(shipped_sample() / "clean").raw_messages(["/ego/lidar/points"])
    server.advertise(PublishedTopic(raw.topic, raw.schema))
    with viewer(server, 4) as slow:
        server.publish("/info", words("begin"), 0)
        slow.subscribe(raw.topic.name, "/info")
        assert slow.next()[0] == "/info"
        for number in range(4 * BACKLOG):
            server.publish(raw.topic.name, raw.cdr, number)
        server.publish("/info", words("end"), 0)
        got = list(iter(lambda: slow.next()[:2], ("/info", 0)))
    times = [time_ns for _, time_ns in got]
    assert times == sorted(times)
    assert times[-1] == 4 * BACKLOG - 1
    assert len(times) < 2 * BACKLOG
    assert server.missed().uncounted
    said = capsys.readouterr().err
    assert re.fullmatch(
        r"Foxglove: a viewer is too slow \(outbox for client 127\.0\.0\.1:\d+ full\); .*\n", said
    )


def test_a_port_that_is_taken(server: FoxgloveServer) -> None:
    port = int(server.url.rpartition(":")[2])
    with pytest.raises(UsageError, match=rf"^port {port} of 127.0.0.1 cannot be used \(.*in use.*\); choose"):
        FoxgloveServer(port)


def test_only_this_machine_is_served(server: FoxgloveServer) -> None:
    assert server.url.startswith("ws://127.0.0.1:")
