"""The connection to a CARLA server, by CARLA's own client library.

Only this folder imports `carla`, and only inside functions: it is an extra.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, UsageError, one_line
from advpipe.pipeline.core.versions import installed as installed_version
from advpipe.pipeline.scenario.carla import Carla

VERSION = "0.9.16"
"""The release whose client and server are supported; the protocol differs between releases."""

REACH_TIMEOUT_S = 5.0


def carla_library() -> Any:
    """The module `carla`. Raises UsageError if it is missing, or of another release."""
    try:
        import carla
    except ImportError as error:
        raise UsageError(
            "world carla needs CARLA's client: pip install 'advpipe[carla]', with Python 3.10 to 3.12 on "
            f"Linux or Windows ({one_line(error)})"
        ) from None
    installed = installed_version("carla")
    if installed != VERSION:
        raise UsageError(
            f"CARLA's client is {installed or 'of an unknown version'}, but {VERSION} is needed: "
            f"pip install carla=={VERSION}"
        )
    return carla


@contextmanager
def carla_errors(settings: Carla) -> Iterator[None]:
    """Convert the client's exceptions to a one-line AdvpipeError."""
    try:
        yield
    except RuntimeError as error:
        reason = one_line(error)
        if "time-out" in reason:
            raise AdvpipeError(
                f"CARLA at {settings.server} does not respond within {settings.timeout_s:g} s; is it still "
                "running, and synchronous for no other client? (carla.timeout_s sets the wait)"
            ) from None
        raise AdvpipeError(f"CARLA at {settings.server}: {reason}") from None


def connect(settings: Carla) -> Any:
    """A `carla.Client` of a server of the supported release.

    Raises AdvpipeError for a server that does not respond, and UsageError for one of another release.
    """
    carla = carla_library()
    host, _, port = settings.server.rpartition(":")
    _check_reachable(settings, host, int(port))
    with carla_errors(settings):
        client = carla.Client(host, int(port))
        client.set_timeout(settings.timeout_s)
        version = str(client.get_server_version())
    if version != VERSION:
        raise UsageError(
            f"the server at {settings.server} is CARLA {version}, but {VERSION} is needed; start that release"
        )
    return client


def _check_reachable(settings: Carla, host: str, port: int) -> None:
    """Raise AdvpipeError at once if nothing listens, where the client would wait for its whole time-out."""
    try:
        socket.create_connection((host, port), timeout=min(REACH_TIMEOUT_S, settings.timeout_s)).close()
    except (OSError, OverflowError) as error:
        number = error.errno if isinstance(error, OSError) else None
        reason = os.strerror(number) if number is not None and number > 0 else one_line(error)
        raise AdvpipeError(
            f"no CARLA server at {settings.server} ({reason}); start CARLA {VERSION} "
            "(./CarlaUE4.sh -RenderOffScreen), or set carla.server"
        ) from None
