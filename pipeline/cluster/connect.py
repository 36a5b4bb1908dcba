"""Connects to a Ray cluster; what is wrong with its address or its versions is said in one line."""

from __future__ import annotations

import os
import re
import signal
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from advpipe.pipeline.cluster.ray_tasks import RayTasks
from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, one_line
from advpipe.pipeline.core.job_engine import use_engine
from advpipe.pipeline.core.missing_library import missing_library_line
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.core.verbosity import detail

AUTO = "auto"
CONNECT_S = 5.0

_ADDRESS = re.compile(r"(?P<host>[\w.-]+|\[[0-9a-fA-F:]+\]):(?P<port>[0-9]{1,5})", re.ASCII)
_HTTP2_SETTINGS = b"\x04"
_HTTP2_HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\0\0\0" + _HTTP2_SETTINGS + bytes(5)
"""What a client of gRPC sends first; a server of gRPC, as Ray's head is, answers with its settings, too."""

_VERSIONS = re.compile(r"Ray: (?P<ray>\S+).*?Python: (?P<python>\S+)", re.DOTALL)


@contextmanager
def use_cluster(address: str | None, device: str = "cpu") -> Iterator[None]:
    """Within the block, jobs run as tasks of a Ray cluster; without an address, on this machine.

    address: `host:port` of its head, or `auto` for the one that RAY_ADDRESS names or that runs on this
    machine. device: with `cuda`, each task has a GPU of its own.

    Raises UsageError for an address that is none and for `cuda:N`, and AdvpipeError where no Ray answers or
    its versions differ.
    """
    if address is None:
        yield
        return
    if device.startswith("cuda:"):
        raise UsageError(f"device {device}: Ray assigns the GPUs; with a cluster, give cuda")
    if address == AUTO:
        address = os.environ.get("RAY_ADDRESS") or AUTO
    _refuse_silent(address)
    ray = _loaded_ray()
    if ray.is_initialized():
        with _engine_of(address, device):
            yield
        return
    with _own_messages(ray):
        try:
            _connect(ray, address)
            with _engine_of(address, device):
                yield
        finally:
            ray.shutdown()  # also half a connection, which one to other versions leaves


@contextmanager
def _engine_of(address: str, device: str) -> Iterator[None]:
    engine = RayTasks(gpus=int(device == "cuda"))
    engine.refuse_without_slots()
    detail(f"cluster {address}: {engine.slots()} tasks at a time")
    with use_engine(engine):
        yield


def _loaded_ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise AdvpipeError(missing_library_line(error) or str(error)) from None
    return ray


def _refuse_silent(address: str) -> None:
    """Raise for an address that is none, or where nobody answers: Ray itself would try for a minute."""
    if address == AUTO:
        return
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) < 2**16:
        raise UsageError(
            f"{option_name('cluster')} {short_repr(address)} is no address of a Ray cluster; give host:port, "
            f"such as 10.0.0.1:6379, or {AUTO}"
        )
    place = found["host"].strip("[]"), int(found["port"])
    try:
        with socket.create_connection(place, CONNECT_S) as connection:
            connection.settimeout(CONNECT_S)
            connection.sendall(_HTTP2_HELLO)
            reason = "" if connection.recv(9)[3:4] == _HTTP2_SETTINGS else "another program does"
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        raise AdvpipeError(
            f"no Ray cluster answers at {address} ({reason}); start one with `ray start --head`, which "
            "prints its address"
        )


def _connect(ray: Any, address: str) -> None:
    with _own_signal_handlers():
        try:
            ray.init(address=address, namespace="advpipe", log_to_driver=False, logging_level="ERROR")
        except ConnectionError:
            where = "on this machine, and RAY_ADDRESS is not set" if address == AUTO else f"at {address}"
            raise AdvpipeError(
                f"no Ray cluster answers {where}; start one with `ray start --head`, which prints its address"
            ) from None
        except Exception as error:
            found = [match.group("ray", "python") for match in _VERSIONS.finditer(str(error))]
            if len(found) == 2:
                (their_ray, their_python), (our_ray, our_python) = found
                raise AdvpipeError(
                    f"the cluster at {address} runs Ray {their_ray} on Python {their_python}, and this "
                    f"program Ray {our_ray} on Python {our_python}; install the same versions"
                ) from None
            raise AdvpipeError(f"the cluster at {address} cannot be used: {one_line(error, 300)}") from None


@contextmanager
def _own_messages(ray: Any) -> Iterator[None]:
    """Within the block, say only with --verbose what Ray says of its nodes, such as of a lost one, which we
    say ourselves.

    Ray prints it on standard output, where results go, and has no option against it.
    """
    worker = getattr(getattr(ray, "_private", None), "worker", None)
    former = getattr(worker, "print_to_stdstream", None)
    if worker is None or former is None:
        yield
        return
    worker.print_to_stdstream = _say_detail
    try:
        yield
    finally:
        worker.print_to_stdstream = former


def _say_detail(data: Mapping[str, Any], **_: Any) -> None:
    for line in data.get("lines", ()):
        detail(f"Ray: {one_line(line, 300)}")


@contextmanager
def _own_signal_handlers() -> Iterator[None]:
    """Restore the handlers of signals that Ray replaces by its own."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in signals.REASONS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
