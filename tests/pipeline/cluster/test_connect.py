"""Addresses where no cluster can be had: one line each, before anything else is done."""

from __future__ import annotations

import socket
import sys
import threading
from types import SimpleNamespace

import pytest

from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.job_engine import chosen_engine, runs_elsewhere


def test_without_an_address_jobs_stay_here() -> None:
    with use_cluster(None):
        assert chosen_engine() is None
        assert not runs_elsewhere()


@pytest.mark.parametrize(
    "address", ["", "somewhere", "host:", "host:0", "host:70000", "http://host:8265", "a b:1", "ray://host"]
)
def test_what_is_no_address_is_refused(address: str) -> None:
    with (
        pytest.raises(UsageError, match=r"is no address of a Ray cluster; give host:port"),
        use_cluster(address),
    ):
        pass


def test_an_address_where_nobody_answers() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{unused.getsockname()[1]}"
        with (
            pytest.raises(
                AdvpipeError, match=rf"^no Ray cluster answers at {address} \(.*refused\); start one"
            ),
            use_cluster(address),
        ):
            pass


@pytest.mark.parametrize("answer", [b"HTTP/1.1 400 Bad Request\r\n\r\n", b""], ids=["web server", "hangs up"])
def test_an_address_where_another_program_answers(answer: bytes) -> None:
    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            connection.recv(100)
            connection.sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, daemon=True).start()
        refused = pytest.raises(
            AdvpipeError, match=r"^no Ray cluster answers at \S+ \(another program does\); "
        )
        with refused, use_cluster(f"127.0.0.1:{server.getsockname()[1]}"):
            pass


def test_the_environment_names_the_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", "nowhere")
    with pytest.raises(UsageError, match=r"'nowhere' is no address of a Ray cluster"), use_cluster("auto"):
        pass


def test_one_gpu_of_several_cannot_be_named() -> None:
    with (
        pytest.raises(UsageError, match=r"^device cuda:1: Ray assigns the GPUs"),
        use_cluster("a:1", "cuda:1"),
    ):
        pass


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(AdvpipeError, match=r"pip install 'advpipe\[cluster\]'"), use_cluster("auto"):
        pass


class Unreachable(SimpleNamespace):
    """A Ray of another version, or without a cluster."""

    @staticmethod
    def is_initialized() -> bool:
        return False

    @staticmethod
    def init(**_: object) -> None:
        raise ConnectionError

    @staticmethod
    def shutdown() -> None:
        pass


def own_printing(*_: object, **__: object) -> None:
    """What Ray prints with."""


@pytest.mark.parametrize(
    "internals",
    [
        {},
        {"_private": SimpleNamespace()},
        {"_private": SimpleNamespace(worker=SimpleNamespace())},
        {"_private": SimpleNamespace(worker=SimpleNamespace(print_to_stdstream=own_printing))},
    ],
    ids=["none", "no worker", "no printing", "printing"],
)
def test_a_failed_connection_leaves_ray_as_it_was(
    monkeypatch: pytest.MonkeyPatch, internals: dict[str, SimpleNamespace]
) -> None:
    """Also a Ray whose internals are others."""
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    ray = Unreachable(**internals)
    monkeypatch.setitem(sys.modules, "ray", ray)
    with pytest.raises(AdvpipeError, match=r"^no Ray cluster answers on this machine"), use_cluster("auto"):
        pass
    worker = getattr(getattr(ray, "_private", None), "worker", None)
    assert getattr(worker, "print_to_stdstream", own_printing) is own_printing
