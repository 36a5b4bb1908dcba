"""CARLA 0.9.16's protocol as its client speaks it: remote calls in MessagePack, and streams of measurements.

A call is `[0, id, method, [[is_asynchronous], *arguments]]`; its answer is `[1, id, error or nil, result]`. A
client subscribes to a stream by connecting to the stream port and sending the stream's number; it then gets
messages, each after its length. Everything on a stream is packed and little-endian.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import socket
import struct
import traceback
from collections import defaultdict
from collections.abc import Awaitable, Callable
from typing import Any

import msgpack

Handler = Callable[..., Any]

SUBSCRIPTION_TIMEOUT_S = 1.0
"""A real server does not wait for clients that have asked for a stream; waiting makes tests repeatable."""


class RefusedError(Exception):
    """An answer that the client raises as a RuntimeError with this text."""


class Streams:
    """The port of the streams, and who listens to which stream."""

    def __init__(self, host: str) -> None:
        self._host, self.port = host, 0
        self._listeners: dict[int, list[asyncio.StreamWriter]] = defaultdict(list)
        self._announced: set[int] = set()

    async def open(self) -> None:
        server = await asyncio.start_server(self._serve, self._host, 0)
        self.port = server.sockets[0].getsockname()[1]

    def token(self, stream: int) -> bytes:
        """24 bytes: stream, port, protocol (1: TCP), kind of address (1: IPv4), address."""
        address = socket.inet_aton(self._host) + bytes(12)
        return struct.pack("<IHBB", stream, self.port, 1, 1) + address

    def announce(self, stream: int) -> None:
        """Note that a client is about to subscribe."""
        self._announced.add(stream)

    async def settle(self) -> None:
        """Wait until the announced clients have subscribed."""
        for _ in range(int(SUBSCRIPTION_TIMEOUT_S / 0.001)):
            if not self._announced:
                return
            await asyncio.sleep(0.001)
        self._announced.clear()

    def has_listener(self, stream: int) -> bool:
        return bool(self._listeners[stream])

    def send(self, stream: int, message: bytes) -> None:
        for listener in self._listeners[stream]:
            listener.write(struct.pack("<I", len(message)) + message)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
            (stream,) = struct.unpack("<I", await reader.readexactly(4))
            self._listeners[stream].append(writer)
            self._announced.discard(stream)
            await reader.read()  # until the client leaves: it sends nothing more
        for listeners in self._listeners.values():
            if writer in listeners:
                listeners.remove(writer)
        writer.close()


class RemoteCalls:
    """The port of the remote calls. `handlers` by method; `is_void` for those that return nothing."""

    def __init__(self, host: str, handlers: dict[str, Handler]) -> None:
        self._host, self._handlers = host, handlers

    async def open(self, port: int) -> int:
        server = await asyncio.start_server(self._serve, self._host, port)
        return int(server.sockets[0].getsockname()[1])

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        unpacker = msgpack.Unpacker(raw=False, strict_map_key=False, max_buffer_size=1 << 28)
        with contextlib.suppress(ConnectionError):
            while received := await reader.read(1 << 16):
                unpacker.feed(received)
                for kind, number, method, arguments in unpacker:
                    assert kind == 0, kind
                    error, result = await self._answer(method, arguments[1:])
                    writer.write(msgpack.packb([1, number, error, result]))
        writer.close()

    async def _answer(self, method: str, arguments: list[Any]) -> tuple[str | None, Any]:
        handler = self._handlers.get(method)
        if handler is None:
            print(f"unknown call {method}", flush=True)
            return f"rpclib: server could not find function '{method}'", None
        is_void = inspect.signature(handler).return_annotation in (None, "None")
        try:
            value = handler(*arguments)
            value = await value if isinstance(value, Awaitable) else value
        except RefusedError as refusal:
            return None, [[True, [str(refusal)]]] if is_void else refused(refusal)
        except Exception as error:  # a fault of this program: the client sees it, too
            traceback.print_exc()
            return f"{type(error).__name__}: {error}", None
        if method == "apply_batch":  # the one result without a frame around it
            return None, value
        return None, [[False]] if is_void else accepted(value)


def accepted(value: Any) -> list[Any]:
    """A value, or an error instead: the first alternative is the error."""
    return [[1, value]]


def refused(refusal: RefusedError) -> list[Any]:
    return [[0, [str(refusal)]]]


def sensor_header(sensor_type: int, frame: int, elapsed_s: float, pose: list[float]) -> bytes:
    """The head of each measurement; pose: x, y, z in metres, pitch, yaw, roll in degrees."""
    return struct.pack("<QQd6f", sensor_type, frame, elapsed_s, *pose)


def snapshot_head(episode: int, step_s: float, is_new_map: bool) -> bytes:
    """The head of a snapshot of all actors: episode, platform time, step, origin of the map, changes."""
    return struct.pack("<Qdf3iI", episode, 0.0, step_s, 0, 0, 0, int(is_new_map))


def actor_state(
    actor: int, pose: list[float], velocity: Any, turn_rate: Any, acceleration: Any, own: bytes
) -> bytes:
    """One actor of a snapshot; own: what its type adds, at most 54 bytes."""
    state = struct.pack("<IB6f9f", actor, 1, *pose, *velocity, *turn_rate, *acceleration)
    return state + own.ljust(54, b"\0")
