"""A Ray cluster on this machine for tests: a head without cores, and nodes of one core each."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

STORE_BYTES = 100 << 20


class RayCluster:
    """Nodes can be added and killed."""

    def __init__(self) -> None:
        pytest.importorskip("ray")
        from ray.cluster_utils import Cluster

        head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": STORE_BYTES}
        self._cluster = Cluster(initialize_head=True, head_node_args=head)
        self.address: str = self._cluster.address
        self._started: list[subprocess.Popen[bytes]] = []

    def add(self, variables: Mapping[str, str] | None = None, **resources: int) -> Any:
        """A node of one core; variables: of its workers' environment."""
        added = {"num_cpus": 1, "object_store_memory": STORE_BYTES, **resources}
        return self._cluster.add_node(**added, env_vars=dict(variables or {}))

    def kill(self, node: Any) -> None:
        """Kill all processes of a node, as a power failure does."""
        self._cluster.remove_node(node, allow_graceful=False)

    def add_without(self, folder: Path) -> None:
        """A node that does not see a folder: it starts in a mount namespace where the folder is empty."""
        ray = Path(sys.executable).with_name("ray")
        start = (
            f"{ray} start --address={self.address} --num-cpus=1 --object-store-memory={STORE_BYTES} --block"
        )
        hidden = f"mount -t tmpfs none {folder} && exec {start}"
        process = subprocess.Popen(
            ["unshare", "--mount", "sh", "-c", hidden],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._started.append(process)

    def end(self) -> None:
        for process in self._started:
            os.killpg(process.pid, 9)
            process.wait()
        self._cluster.shutdown()


@contextmanager
def ray_cluster(nodes: int) -> Iterator[RayCluster]:
    """A cluster with nodes of one core."""
    cluster = RayCluster()
    try:
        for _ in range(nodes):
            cluster.add()
        yield cluster
    finally:
        cluster.end()


def can_hide_folders() -> bool:
    """Whether this user may mount."""
    try:
        return not subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode
    except OSError:
        return False
