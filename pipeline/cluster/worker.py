"""What runs in a worker of the cluster: it loads once what its jobs need, and does one job a task."""

from __future__ import annotations

import io
import os
import platform
import socket
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from advpipe.pipeline.cluster.inputs import Input, MissingInputsError, unpacked
from advpipe.pipeline.core.code import PACKAGE, code_sha256
from advpipe.pipeline.core.compiled import compiled_library, compiler_version
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_errors import error_for_parent
from advpipe.pipeline.core.option_names import use_flags
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.core.verbosity import WorkerLine, collected
from advpipe.pipeline.core.versions import installed

_LIBRARIES = ("numpy", "scipy", "torch", "open3d-cpu", "open3d", "libsumo")
_CODE = ("pipeline", "stages")
_COMPILED = PACKAGE / "pipeline/detector/common/sparse.c"

MOST_PRINTED_LINES = 20
"""Of what a plug-in prints by itself in one job."""


@dataclass(frozen=True)
class Machine:
    """What the last bits of results depend on, beside the code."""

    processor: str
    libraries: tuple[str, ...]


@dataclass(frozen=True)
class Finished:
    """What a job returned; machine: the one that did it. lines: what was said while it was done."""

    result: Any
    machine: Machine
    lines: tuple[WorkerLine, ...] = ()
    host: str = ""


@dataclass(frozen=True)
class Failed:
    """The error that a job raised, and what was said before."""

    error: Exception
    lines: tuple[WorkerLine, ...] = ()
    host: str = ""


@dataclass(frozen=True)
class Missing:
    """The job was not done, as its node lacks inputs. node_id: Ray's; host: its name for people."""

    node_id: str
    host: str
    inputs: tuple[Input, ...]


NodeCopies = Mapping[str, Mapping[str, str]]
"""By Ray's node, the place of each copy of an input by the driver's path."""

Outcome = Finished | Failed | Missing


@dataclass(frozen=True)
class JobBatch:
    """What all jobs of one call have in common.

    key: differs between calls. content, inputs: see `packed`. writes: the folder in which jobs write, and a
    file in it with the key, by which a worker knows the folder. code: of the driver's advpipe.
    """

    key: str
    content: bytes
    inputs: tuple[Input, ...]
    writes: str | None
    code: str
    names_flags: bool
    sys_path: tuple[str, ...] = field(default_factory=lambda: tuple(sys.path))


@dataclass
class _Loaded:
    key: str
    work: Callable[[int], Any]
    last_job: int


_loaded: _Loaded | None = None


def do_job(
    read_batch: Callable[[], JobBatch], key: str, job: int, copies: NodeCopies, verbose: bool
) -> Outcome:
    """Do one job of a batch; what the batch needs is loaded in the first of its jobs.

    It is loaded anew for a job before the last one, such as one of a lost node: the function that `prepare`
    returns takes jobs in rising order.
    """
    global _loaded
    printed, host = io.StringIO(), socket.gethostname()

    def lines() -> tuple[WorkerLine, ...]:
        others = printed.getvalue().splitlines()[:MOST_PRINTED_LINES]
        return (*said, *(WorkerLine(one_line(text)) for text in others if text.strip()))

    with collected(verbose) as said, redirect_stdout(printed), redirect_stderr(printed):
        try:
            if _loaded is None or _loaded.key != key or job < _loaded.last_job:
                _loaded = None  # frees the memory before the next is loaded
                _loaded = _load(read_batch(), job, copies)
            _loaded.last_job = job
            result = _loaded.work(job)
        except MissingInputsError as error:
            return Missing(this_node(), host, error.inputs)
        except Exception as error:
            return Failed(error_for_parent(error), lines(), host)
    return Finished(result, this_machine(), lines(), host)


def code_of_advpipe() -> str:
    """Identifies the sources of advpipe that this process runs."""
    return code_sha256(*_CODE)


@cache
def this_machine() -> Machine:
    """The machine that this process runs on."""
    found = ((name, installed(name)) for name in _LIBRARIES)
    versions = [f"{name} {version}" for name, version in found if version]
    if compiled_library(_COMPILED) is not None:
        versions.append(f"compiled by {compiler_version()}")
    return Machine(_processor(), tuple(versions))


def this_node() -> str:
    """Ray's identity of the node that this process runs on."""
    import ray

    return str(ray.get_runtime_context().get_node_id())


def key_file(folder: str | Path, key: str) -> Path:
    """The file by which workers recognise the folder that they are to write in."""
    return Path(folder) / f".{key}.cluster"


def _load(batch: JobBatch, job: int, copies: NodeCopies) -> _Loaded:
    host = socket.gethostname()
    if batch.code != code_of_advpipe():
        raise AdvpipeError(
            f"the cluster's node {host} has other sources of advpipe (version {installed('advpipe')}); "
            "install the same ones on all nodes"
        )
    if batch.writes is not None and not key_file(batch.writes, batch.key).is_file():
        raise AdvpipeError(
            f"the cluster's node {host} does not see {batch.writes}; write to a folder that all nodes share"
        )
    sys.path += [path for path in batch.sys_path if path not in sys.path and os.path.isdir(path)]
    with use_flags(batch.names_flags):
        work = unpacked(batch.content, batch.inputs, copies.get(this_node(), {}))()

    def work_with_flags(job: int) -> Any:
        with use_flags(batch.names_flags):
            return work(job)

    return _Loaded(batch.key, work_with_flags, job)


def _processor() -> str:
    """The processor's model; on systems without /proc, its architecture."""
    try:
        lines: Sequence[str] = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = ()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
