"""Copies of inputs on nodes that do not see them: each travels through Ray's object store once a node."""

from __future__ import annotations

import shutil
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from advpipe.pipeline.cluster.inputs import Input
from advpipe.pipeline.cluster.worker import Missing
from advpipe.pipeline.core.errors import AdvpipeError, os_error_line
from advpipe.pipeline.core.lock import LOCK_NAME, remove_folder, take_lock, take_stale_lock
from advpipe.pipeline.core.verbosity import detail

PART_BYTES = 1 << 26
PARTS_IN_FLIGHT = 2
"""How much of a file is in the object store at a time: 128 MiB, whatever its size."""

_PREFIX = "advpipe-inputs-"


class NodeFolder:
    """An actor on a node: a folder with copies, which it removes when it ends.

    A folder whose actor was killed is removed by the next one on the node: its lock is free.
    """

    def __init__(self) -> None:
        temporary = Path(tempfile.gettempdir())
        for old in temporary.glob(f"{_PREFIX}*"):
            if lock := take_stale_lock(old / LOCK_NAME):
                with lock:
                    remove_folder(old)
        self._folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        self._lock = take_lock(self._folder / LOCK_NAME)
        self._count = 0

    def place(self, path: str, size: int) -> str | None:
        """Where the copy of an input will lie, under its own name; None without room for it."""
        if shutil.disk_usage(self._folder).free < size:
            return None
        self._count += 1
        return str(self._folder / str(self._count) / Path(path).name)

    def append(self, place: str, content: bytes) -> str:
        """Append a part to a file of a copy; returns the error, if any."""
        try:
            file = Path(place)
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("ab") as stream:
                stream.write(content)
        except OSError as error:
            return os_error_line(error)
        return ""

    def remove(self) -> None:
        """Remove all copies."""
        remove_folder(self._folder)


@dataclass
class Copies:
    """The copies on all nodes; by Ray's node, a copy's place by the driver's path."""

    places: dict[str, dict[str, str]] = field(default_factory=dict)
    _folders: dict[str, Any] = field(default_factory=dict)

    def make(self, missing: Missing) -> None:
        """Copy inputs to a node that misses them. Raises AdvpipeError if it has no room for them."""
        import ray

        here = self.places.setdefault(missing.node_id, {})
        for wanted in missing.inputs:
            if wanted.path in here:
                continue
            detail(f"copying {wanted.path} to {missing.host}")
            folder = self._folder_on(missing.node_id)
            place = ray.get(folder.place.remote(wanted.path, wanted.size))
            if place is None:
                raise AdvpipeError(
                    f"the cluster's node {missing.host} does not see {wanted.path} and has no room for a "
                    f"copy of its {wanted.size / 1e6:,.0f} MB; put it on a file system that all nodes share"
                )
            waiting: deque[Any] = deque()
            for name, part in _parts(wanted):
                target = f"{place}/{name}" if name else place
                waiting.append(folder.append.remote(target, part))
                while len(waiting) >= PARTS_IN_FLIGHT:
                    _check(ray.get(waiting.popleft()), missing.host, wanted)
            for last in waiting:
                _check(ray.get(last), missing.host, wanted)
            here[wanted.path] = place

    def remove(self) -> None:
        """Remove all copies; those of nodes that were lost are left."""
        import ray

        for folder in self._folders.values():
            with suppress(ray.exceptions.RayError):
                ray.get(folder.remove.remote(), timeout=10)
            ray.kill(folder)
        self.places.clear()
        self._folders.clear()

    def _folder_on(self, node_id: str) -> Any:
        import ray
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        if node_id not in self._folders:
            here = NodeAffinitySchedulingStrategy(node_id, soft=False)
            actor = ray.remote(NodeFolder)
            self._folders[node_id] = actor.options(num_cpus=0, scheduling_strategy=here).remote()
        return self._folders[node_id]


def _parts(wanted: Input) -> Iterator[tuple[str, bytes]]:
    """The files of an input in parts; an empty file has one part."""
    for file in wanted.files:
        with (Path(wanted.path) / file.name if file.name else Path(wanted.path)).open("rb") as stream:
            yield file.name, stream.read(PART_BYTES)
            while part := stream.read(PART_BYTES):
                yield file.name, part


def _check(problem: str, host: str, wanted: Input) -> None:
    if problem:
        raise AdvpipeError(
            f"the cluster's node {host} does not see {wanted.path}, and copying it there failed: {problem}"
        )
