"""Ports of this machine, for the traffic simulator as a server."""

from __future__ import annotations

import socket

from advpipe.pipeline.core.errors import AdvpipeError

LOCALHOST = "127.0.0.1"


def free_port(wanted: int | None) -> int:
    """The wanted port, or any free port if it is None. Raises AdvpipeError if the wanted port is in use."""
    with socket.socket() as probe:
        try:
            probe.bind((LOCALHOST, wanted or 0))
        except OSError as error:
            raise AdvpipeError(
                f"traffic.server.port: {wanted} is not available ({error.strerror}); choose another"
            ) from None
        return int(probe.getsockname()[1])
