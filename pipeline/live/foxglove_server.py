"""Serves topics to Foxglove and other viewers that speak its WebSocket protocol."""

from __future__ import annotations

import logging
from collections import deque
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any

import foxglove
from foxglove.websocket import Capability

from advpipe.pipeline.core.errors import UsageError, one_line
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.live import FOXGLOVE_PORT
from advpipe.pipeline.live.offered_qos import offered_qos
from advpipe.pipeline.live.publisher import Missed, PublishedTopic
from advpipe.pipeline.messages.topics import CLOCK

HOST = "127.0.0.1"
BACKLOG = 256
"""Messages that are kept for a viewer that is too slow; beyond it, it misses the oldest. A step of a drive
with many radios has some hundred, which come at once."""

_STOP_S = 2.0
"""For which the end waits; a viewer that reads nothing would hold it up for as long as it is there."""

_SDK_LOG = "foxglove"
_BACKLOG_LOG = f"{_SDK_LOG}.websocket.connected_client.send_lossy"
"""Where the SDK says that the backlog of a viewer is full, all that it tells of slow viewers."""


class FoxgloveServer:
    """A WebSocket server on this machine; port 0 is any free one, and `url` names the one that it became.

    A viewer that subscribes to a latched topic receives what the topic keeps. A slow viewer misses messages;
    it slows nobody. Raises UsageError for a port that is taken.
    """

    def __init__(self, port: int = FOXGLOVE_PORT) -> None:
        self._slow = _SlowViewers()
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._kept: dict[str, deque[tuple[bytes, int]]] = {}
        self._lock = Lock()
        self._wanted: SimpleQueue[str | None] = SimpleQueue()
        try:
            self._server = foxglove.start_server(
                name="advpipe",
                host=HOST,
                port=port,
                capabilities=[Capability.Time],
                server_listener=_Subscriptions(self._wanted),
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except (RuntimeError, OverflowError) as error:
            raise UsageError(
                f"port {port} of {HOST} cannot be used ({one_line(error).rpartition('Error: ')[2]}); "
                "choose another, or 0 for any free one"
            ) from None
        self.url = f"ws://{HOST}:{self._server.port}"
        self._worker = Thread(target=self._send_kept, name="latched topics", daemon=True)
        self._worker.start()

    def advertise(self, published: PublishedTopic) -> None:
        """See `Publisher`; viewers read every type that its schema defines."""
        topic = published.topic
        schema = foxglove.Schema(
            name=topic.type, encoding=published.schema_encoding, data=published.schema.encode()
        )
        offered = offered_qos(topic)
        if offered.is_latched:
            self._kept[topic.name] = deque(maxlen=offered.depth)
        self._channels[topic.name] = foxglove.Channel(
            topic.name, message_encoding="cdr", schema=schema, context=self._context
        )

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        """See `Publisher`; the time is that of the bag, also the server's own on /clock."""
        if topic_name in self._kept:
            with self._lock:
                self._kept[topic_name].append((cdr, time_ns))
                self._channels[topic_name].log(cdr, log_time=time_ns)
        else:
            self._channels[topic_name].log(cdr, log_time=time_ns)
        if topic_name == CLOCK.name:
            self._server.broadcast_time(time_ns)
        return True

    def missed(self) -> Missed:
        """See `Publisher`; the SDK counts nothing."""
        return Missed(uncounted=self._slow.were_there)

    def close(self) -> None:
        """See `Publisher`."""
        self._slow.close()
        self._wanted.put(None)
        self._worker.join()
        for channel in self._channels.values():
            channel.close()
        stopping = Thread(target=self._server.stop, name="end of the server", daemon=True)
        stopping.start()
        stopping.join(_STOP_S)

    def _send_kept(self) -> None:
        """Send what a topic keeps when a viewer subscribes to it; other viewers receive it once more."""
        while (topic_name := self._wanted.get()) is not None:
            with self._lock:
                for cdr, time_ns in self._kept.get(topic_name, ()):
                    self._channels[topic_name].log(cdr, log_time=time_ns)


class _SlowViewers(logging.Handler):
    """Reads the SDK's log, which otherwise stays as quiet as it was."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.were_there = False
        logging.getLogger(_SDK_LOG).addHandler(quiet := logging.NullHandler())
        root, self._log = logging.getLogger(), logging.getLogger(_BACKLOG_LOG)
        root.addHandler(quiet)  # otherwise the SDK would add one that prints everything
        foxglove.set_log_level("INFO")
        root.removeHandler(quiet)
        self._log.propagate = False
        self._log.setLevel(logging.INFO)
        self._log.addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        if not self.were_there:
            self.were_there = True
            notice(
                f"Foxglove: a viewer is too slow ({one_line(record.getMessage())}); beyond {BACKLOG} "
                "messages, it misses the oldest"
            )

    def close(self) -> None:
        self._log.removeHandler(self)
        super().close()


class _Subscriptions:
    """Called by threads of the server, which must not wait: a worker sends what topics keep."""

    def __init__(self, wanted: SimpleQueue[str | None]) -> None:
        self._wanted = wanted

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._wanted.put(channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Nothing to do."""
