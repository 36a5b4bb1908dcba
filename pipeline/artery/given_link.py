"""The connection to our module in Artery where advpipe says, step by step, what is sent."""

from __future__ import annotations

import socket
import time

from advpipe.pipeline.artery.given_records import PROTOCOL
from advpipe.pipeline.artery.process import ArteryProcess
from advpipe.pipeline.artery.records import Hello, Record, RecordParser, StepDone
from advpipe.pipeline.core.errors import AdvpipeError

LOCALHOST = "127.0.0.1"
POLL_S = 0.2
UNFINISHED = "does not finish a step of the simulation"
TOO_OLD = "GivenWorld' not found"
"""What Artery misses if its module is of a version that could not do this."""


class GivenLink:
    """Listens for the module from its construction on, until `close`. timeout_s: longest time for the start,
    and for one step."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._listener = socket.create_server((LOCALHOST, 0))
        self.port = int(self._listener.getsockname()[1])
        self._connection: socket.socket | None = None
        self._process: ArteryProcess | None = None
        self._parser = RecordParser()
        self._records: list[Record] = []

    def connect(self, process: ArteryProcess) -> None:
        """Wait for the module of this process. Raises AdvpipeError if it does not come, or is another."""
        self._process = process
        self._connection = self._accepted()
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        first, *_ = self._until_step_done(0, "does not start")
        if not isinstance(first, Hello) or first.protocol != PROTOCOL:
            raise AdvpipeError(
                "Artery's module speaks another version of advpipe's protocol; build it anew (docs/artery.md)"
            )

    def step(self, block: bytes, until_ns: int) -> list[Record]:
        """Let Artery simulate this block of `given_records`; all that it tells of the step.

        until_ns: Artery's time at the end of the step. Raises AdvpipeError if Artery fails, or is at another
        time then.
        """
        assert self._connection is not None
        try:
            self._connection.sendall(block)
        except TimeoutError:
            raise self._late(UNFINISHED) from None
        except OSError:
            raise self._ended() from None
        return self._until_step_done(until_ns, UNFINISHED)

    def close(self) -> None:
        """Close the connection; Artery, which cannot go on without it, has been ended before."""
        if self._connection is not None:
            self._connection.close()
        self._listener.close()

    def _accepted(self) -> socket.socket:
        assert self._process is not None
        self._listener.settimeout(POLL_S)
        begin_s = time.monotonic()
        while True:
            try:
                return self._listener.accept()[0]
            except TimeoutError:
                if not self._process.is_alive:
                    raise self._ended() from None
                if time.monotonic() - begin_s > self._timeout_s:
                    raise self._late("does not start") from None

    def _until_step_done(self, until_ns: int, late: str) -> list[Record]:
        found = list[Record]()
        while not (found and isinstance(found[-1], StepDone)):
            found += self._parser.feed(self._received(late))
        if found[-1].time_ns != until_ns:
            raise AdvpipeError(f"Artery is at {found[-1].time_ns} ns when the drive is at {until_ns} ns")
        return found

    def _received(self, late: str) -> bytes:
        assert self._connection is not None
        self._connection.settimeout(self._timeout_s)
        try:
            data = self._connection.recv(1 << 16)
        except TimeoutError:
            raise self._late(late) from None
        except OSError:
            raise self._ended() from None
        if not data:
            raise self._ended()
        return data

    def _late(self, what: str) -> AdvpipeError:
        return AdvpipeError(
            f"Artery {what} within {self._timeout_s:g} s; record the drive with a larger artery.timeout_s if "
            "it needs longer"
        )

    def _ended(self) -> AdvpipeError:
        assert self._process is not None
        reason = self._process.end_reason()
        if TOO_OLD in reason:
            return AdvpipeError(
                "Artery's module is too old to attack a drive; build it anew (docs/artery.md)"
            )
        return AdvpipeError(f"Artery ended: {reason}")
