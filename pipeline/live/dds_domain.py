"""A DDS domain: which network interface it is on, and how it is configured."""

from __future__ import annotations

import os
import re
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.qos import Policy, Qos

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.live import MOST_DOMAIN_ID

LOOPBACK = "lo"

_TIME_AND_THREAD = re.compile(r"^[\d.]+ \[\d*\]\s+\S+: ")
"""Before each line that Cyclone prints."""

_GENERAL = "<MaxMessageSize>65500B</MaxMessageSize>"
"""Fewer, larger datagrams: with Cyclone's default fragments, best effort loses half of the large clouds."""

_RECEIVING = '<Internal><SocketReceiveBufferSize max="4MB"/></Internal>'
"""As large as the system allows, up to this: a cloud is some dozens of datagrams that come at once."""

_USER_DATA = b"enclave=/;"
"""By which ROS 2 recognises a participant of its own."""

_LOCAL_DISCOVERY = (
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60"
    '</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
)
"""The loopback interface has no multicast, so participants ask each of the domain's ports."""


def domain_id_of_environment() -> int:
    """ROS_DOMAIN_ID as ROS 2 reads it; 0 without it. Raises UsageError for one that is no domain."""
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > MOST_DOMAIN_ID:
        raise UsageError(f"ROS_DOMAIN_ID is {one_line(text)[:40]}, but must be from 0 to {MOST_DOMAIN_ID}")
    return int(text)


def domain_configuration(interface: str | None) -> str:
    """Cyclone's configuration: files or XML texts, the user's own of CYCLONEDDS_URI if no interface is named.

    interface: None for Cyclone's choice, or for the loopback where ROS 2 is told to stay on this machine.
    Raises UsageError for an interface that this machine lacks.
    """
    if interface is None and (own := os.environ.get("CYCLONEDDS_URI")):
        return own  # which Cyclone reads by itself only for domains without a configuration
    if interface is None and _stays_on_this_machine():
        interface = LOOPBACK
    if interface is None:
        return f"<CycloneDDS><Domain><General>{_GENERAL}</General>{_RECEIVING}</Domain></CycloneDDS>"
    names = [name for _, name in socket.if_nameindex()]
    if interface not in names:
        raise UsageError(
            f"this machine has no network interface {interface}; {known_names(interface, names, 'it has')}"
        )
    is_loopback = interface == LOOPBACK
    multicast = ' multicast="false"' if is_loopback else ""
    chosen = f"<Interfaces><NetworkInterface name={quoteattr(interface)}{multicast}/></Interfaces>"
    return (
        f"<CycloneDDS><Domain><General>{chosen}{_GENERAL}</General>"
        f"{_RECEIVING}{_LOCAL_DISCOVERY if is_loopback else ''}</Domain></CycloneDDS>"
    )


class DdsDomain:
    """A participant of a DDS domain. Raises AdvpipeError, one line, where there is no usable interface."""

    def __init__(self, domain_id: int, interface: str | None = None) -> None:
        configuration = domain_configuration(interface)
        with _printed_by_cyclone() as printed:
            try:
                self._domain = Domain(domain_id, configuration)
                self.participant = DomainParticipant(domain_id, qos=Qos(Policy.Userdata(_USER_DATA)))
            except DDSException as error:
                reason = printed() or one_line(error)
                where = f"interface {interface}" if interface else "a network interface"
                raise AdvpipeError(f"DDS domain {domain_id} cannot be joined on {where}: {reason}") from None

    def close(self) -> None:
        """Leave the domain; all topics and writers in it end."""
        del self.participant, self._domain


def _stays_on_this_machine() -> bool:
    return (
        os.environ.get("ROS_LOCALHOST_ONLY") == "1"
        or os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST"
    )


@contextmanager
def _printed_by_cyclone() -> Iterator[Callable[[], str]]:
    """Keep what Cyclone's C library prints to standard error in the block; yields a function that returns
    its last line, without the time and the thread before it."""
    with tempfile.TemporaryFile() as file:
        before = os.dup(2)
        os.dup2(file.fileno(), 2)

        def last_line() -> str:
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            return one_line(_TIME_AND_THREAD.sub("", lines[-1])) if lines else ""

        try:
            yield last_line
        finally:
            with suppress(OSError):
                os.dup2(before, 2)
            os.close(before)
