"""The connection to our module in Artery, which a thread of its own reads, answers and watches."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from advpipe.pipeline.artery.process import ArteryProcess
from advpipe.pipeline.artery.records import (
    PROTOCOL,
    Ended,
    Hello,
    Record,
    RecordParser,
    StepBegun,
    StepDone,
    VehicleAnswer,
    VehicleQuestion,
)
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.network.artery.clock import DriveClock

LOCALHOST = "127.0.0.1"
POLL_S = 0.2


class ArteryLink:
    """Listens for our module in Artery from its construction on, until `close`.

    SUMO waits for both of its clients, so whoever waits for SUMO would wait for ever for a dead Artery. The
    thread therefore kills an Artery that hangs, whereupon SUMO ends; to a SUMO that still waits for its
    second client, it poses as that client, and leaves. `failure` is then the reason.

    station_of: whether a vehicle has a station. timeout_s: longest time for the start, and for one step.
    """

    def __init__(self, station_of: Callable[[VehicleQuestion], VehicleAnswer], timeout_s: float) -> None:
        self._station_of, self._timeout_s = station_of, timeout_s
        self._listener = socket.create_server((LOCALHOST, 0))
        self.port = int(self._listener.getsockname()[1])
        self.clock = DriveClock()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False
        self._hello: Hello | None = None
        self._records: list[Record] = []
        self._is_its_turn = True
        self._newest_s = time.monotonic()
        self.failure: AdvpipeError | None = None

    def watch(self, process: ArteryProcess, sumo: tuple[str, int]) -> None:
        """Begin to read and watch. sumo: the server that Artery connects to."""
        self._newest_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, args=(process, sumo), daemon=True)
        self._thread.start()

    def wait_for_hello(self) -> None:
        """Wait until our module has been loaded. Raises AdvpipeError if it is not, or of another version."""
        self._wait(lambda: self._hello is not None)
        if self._hello is not None and self._hello.protocol != PROTOCOL:
            raise AdvpipeError(
                f"Artery's module speaks version {self._hello.protocol} of advpipe's protocol, this advpipe "
                f"version {PROTOCOL}; build it anew (docs/artery.md)"
            )

    def wait_for_rest(self) -> None:
        """Wait until Artery has nothing to do but to wait for SUMO's next step."""
        self._wait(lambda: not self._is_its_turn)

    def wait_until(self, stamp_ns: int) -> list[Record]:
        """Wait until Artery has simulated up to this time of the drive; the records since the last call.

        Raises AdvpipeError if Artery fails, or is at another time then.
        """
        self._wait(lambda: self.clock.done_ns is not None and self.clock.done_ns >= stamp_ns)
        if self.clock.done_ns != stamp_ns:
            raise AdvpipeError(
                f"Artery is at {self.clock.done_ns} ns when the drive is at {stamp_ns} ns: their steps differ"
            )
        with self._changed:
            records, self._records = self._records, []
        return records

    def failure_within(self, seconds: float) -> AdvpipeError | None:
        """Why Artery has failed, or fails within this time; None if it does not."""
        with self._changed:
            self._changed.wait_for(lambda: self.failure is not None, seconds)
        return self.failure

    def end_watch(self) -> None:
        """From now on, Artery may end."""
        self._is_closed = True

    def close(self) -> None:
        """End the thread; Artery, which cannot go on without it, has been ended before."""
        self._is_closed = True
        if self._thread is not None:
            self._thread.join()
        self._listener.close()

    def _wait(self, is_so: Callable[[], bool]) -> None:
        """Wait for a change that the thread makes; the thread is what notices that it takes too long."""
        with self._changed:
            while self.failure is None and not is_so():
                self._changed.wait()
            if self.failure is not None:
                raise self.failure

    def _run(self, process: ArteryProcess, sumo: tuple[str, int]) -> None:
        try:
            with self._accepted(process) as connection:
                connection.settimeout(POLL_S)
                parser = RecordParser()
                while not self._is_closed:
                    for record in parser.feed(self._received(connection, process)):
                        self._take(record, connection)
        except AdvpipeError as error:
            self._fail(error, process, sumo)
        except OSError:  # the connection is gone
            if not self._is_closed:
                self._fail(AdvpipeError(f"Artery ended: {process.end_reason()}"), process, sumo)

    def _fail(self, reason: AdvpipeError, process: ArteryProcess, sumo: tuple[str, int]) -> None:
        process.kill()
        with self._changed:
            self.failure = reason
            self._changed.notify_all()
        while not self._is_closed:  # let go a SUMO that waits for its second client
            with suppress(OSError):
                socket.create_connection(sumo, timeout=POLL_S).close()
            time.sleep(POLL_S)

    def _accepted(self, process: ArteryProcess) -> socket.socket:
        self._listener.settimeout(POLL_S)
        while True:
            try:
                return self._listener.accept()[0]
            except TimeoutError:
                self._check(process)

    def _received(self, connection: socket.socket, process: ArteryProcess) -> bytes:
        """The next bytes; empty if there are none yet."""
        try:
            data = connection.recv(1 << 16)
        except TimeoutError:
            self._check(process)
            return b""
        if not data:
            raise ConnectionError
        self._newest_s = time.monotonic()
        return data

    def _check(self, process: ArteryProcess) -> None:
        if not process.is_alive or self._is_closed:
            raise ConnectionError
        if self._is_its_turn and time.monotonic() - self._newest_s > self._timeout_s:
            what = "does not start" if self._hello is None else "does not finish a step of the simulation"
            raise AdvpipeError(
                f"Artery {what} within {self._timeout_s:g} s; raise artery.timeout_s if it needs longer"
            )

    def _take(self, record: Record, connection: socket.socket) -> None:
        if isinstance(record, VehicleQuestion):
            _answer(connection, self._station_of(record).value)
            return
        if isinstance(record, StepBegun):
            _answer(connection, self.clock.begin_step(record.time_ns))
        with self._changed:
            if isinstance(record, Hello):
                self._hello = record
            elif isinstance(record, StepDone):
                self.clock.finish_step(record.time_ns)
            elif not isinstance(record, (StepBegun, Ended)):
                self._records.append(self.clock.in_drive(record))
            self._is_its_turn = not isinstance(record, (Hello, StepDone))
            self._changed.notify_all()


def _answer(connection: socket.socket, text: bytes) -> None:
    connection.sendall(bytes([len(text)]) + text)
