"""The publishers by name."""

from __future__ import annotations

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.live import FOXGLOVE, FOXGLOVE_PORT, PUBLISHERS, ROS2
from advpipe.pipeline.live.publisher import Publisher


def check_publisher_name(name: str) -> None:
    """Raises UsageError for a name that is not in `PUBLISHERS`."""
    if name not in PUBLISHERS:
        raise UsageError(f"unknown publisher {name!r}; {known_names(name, PUBLISHERS)}")


def open_publisher(
    name: str, *, domain: int | None = None, interface: str | None = None, port: int = FOXGLOVE_PORT
) -> tuple[str, Publisher]:
    """Where it publishes, in words, and the publisher; the library is loaded of the one that is named.

    domain, interface: for ROS 2, see `Ros2Node`; by default as in its environment. port: for Foxglove.
    """
    check_publisher_name(name)
    if name == FOXGLOVE:
        from advpipe.pipeline.live.foxglove_server import FoxgloveServer

        server = FoxgloveServer(port)
        return server.url, server
    assert name == ROS2
    from advpipe.pipeline.live.dds_domain import domain_id_of_environment
    from advpipe.pipeline.live.ros2 import Ros2Publisher
    from advpipe.pipeline.live.ros2_node import Ros2Node

    number = domain_id_of_environment() if domain is None else domain
    return f"ROS 2 domain {number}", Ros2Publisher(Ros2Node(number, interface))
