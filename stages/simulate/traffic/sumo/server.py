"""SUMO as a separate server, controlled by TraCI, which other clients may share."""

from __future__ import annotations

import struct
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.missing_library import loader_line
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.scenario.traffic import SumoServer
from advpipe.stages.simulate.road_network.file import last_error, sumo_program
from advpipe.stages.simulate.traffic.ports import LOCALHOST, free_port

START_TIMEOUT_S = 300.0
"""SUMO listens as soon as it has read its options; on a busy machine its start alone takes seconds."""

JOIN_TIMEOUT_S = 10.0
END_TIMEOUT_S = 5.0
"""Time for a server that we started to exit after the drive; other clients may continue until then."""


@dataclass
class Server:
    """A SUMO server, and our connection to it. process, log: of a server that we started, and its output."""

    client: Any
    process: subprocess.Popen[bytes] | None = None
    log: Path | None = None

    def close(self, after_error: bool) -> None:
        """Disconnect, and stop the server if we started it; immediately after an error."""
        import traci

        if self.process is not None and after_error:
            self.process.kill()
        if self.client is not None:
            # struct.error: Ctrl-C may leave half a response unread, which the next command takes for its own.
            with suppress(
                traci.exceptions.TraCIException, traci.exceptions.FatalTraCIError, struct.error, OSError
            ):
                self.client.close(False)
        if self.process is not None:
            try:
                self.process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def exit_reason(self) -> str | None:
        """Why a server that we started has exited; None for one that runs, or that we did not start."""
        if self.process is None or self.log is None:
            return None
        try:
            code = self.process.wait(1.0)
        except subprocess.TimeoutExpired:
            return None
        text = self.log.read_text(encoding="utf-8", errors="replace")
        return loader_line(text) or last_error(subprocess.CompletedProcess([], code, "", text))


def connect(settings: SumoServer, options: Sequence[str], log: Path) -> Server:
    """Connect to the server that the settings name, or start one with options of SUMO's command line.

    If others share the server, it returns once all clients have connected. Raises AdvpipeError for a server
    that does not respond or start; a server of ours is not left running then.
    """
    if settings.join is not None:
        host, _, port = settings.join.rpartition(":")
        server = Server(_connect(host, int(port), JOIN_TIMEOUT_S, Server(None)))
    else:
        server = _start(settings, options, log)
    if settings.join is not None or settings.clients > 1:
        try:
            server.client.setOrder(settings.order)
        except BaseException:
            server.close(after_error=True)
            raise
    return server


def _start(settings: SumoServer, options: Sequence[str], log: Path) -> Server:
    port = free_port(settings.port)
    command = [sumo_program("sumo"), *options, "--remote-port", str(port)]
    command += ["--num-clients", str(settings.clients)]
    with log.open("wb") as log_file:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log_file
        )
    server = Server(None, process, log)
    try:
        server.client = _connect(LOCALHOST, port, START_TIMEOUT_S, server)
        if settings.clients > 1:
            others = f"{settings.clients - 1} more client{'s' * (settings.clients > 2)}"
            notice(f"SUMO listens on port {port} and waits for {others}")
    except BaseException:
        server.close(after_error=True)
        raise
    return server


def _connect(host: str, port: int, timeout_s: float, server: Server) -> Any:
    """A connection to a server that may still be starting."""
    import traci

    until_s = time.monotonic() + timeout_s
    while True:
        if server.process is not None and server.process.poll() is not None:
            raise AdvpipeError(f"SUMO does not start as a server on port {port}: {server.exit_reason()}")
        try:
            return traci.connect(port, numRetries=0, host=host)
        except (traci.exceptions.FatalTraCIError, OSError):
            if time.monotonic() > until_s:
                whose = "it" if server.process is not None else "`sumo --remote-port`"
                raise AdvpipeError(
                    f"no SUMO server responds at {host}:{port} within {timeout_s:g} s; is {whose} running?"
                ) from None
        time.sleep(0.02)
