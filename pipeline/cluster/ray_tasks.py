"""The engine of a Ray cluster: a job is a task, and as many are submitted as can run at a time."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType
from typing import Any, ClassVar, TypeVar
from uuid import uuid4

from advpipe.pipeline.cluster.copies import Copies
from advpipe.pipeline.cluster.inputs import packed
from advpipe.pipeline.cluster.worker import (
    Failed,
    Finished,
    JobBatch,
    Machine,
    Missing,
    Outcome,
    code_of_advpipe,
    key_file,
)
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_engine import JobLimits
from advpipe.pipeline.core.job_errors import raise_error_of_worker
from advpipe.pipeline.core.option_names import is_command_line, option_name
from advpipe.pipeline.core.text import counted, one_line
from advpipe.pipeline.core.verbosity import detail, is_verbose, notice

T = TypeVar("T")

RETRIES = 5
"""How often a job is run again whose worker or node was lost: one that kills its worker ends at some time."""

LOOK_EVERY_S = 2.0
NO_NODE_S = 60.0
"""How long to wait for a node when none is left."""


def _entry(
    batch: list[Any], key: str, job: int, copies: Mapping[str, Mapping[str, str]], verbose: bool
) -> Any:
    """The task: it travels by value, so that a node without advpipe can say so."""
    import socket

    try:
        import ray

        from advpipe.pipeline.cluster.worker import do_job
    except ImportError as error:
        return f"the cluster's node {socket.gethostname()} cannot load advpipe ({error})"
    return do_job(lambda: ray.get(batch[0]), key, job, copies, verbose)


@dataclass
class RayTasks:
    """The engine of a cluster that `ray.init` has connected to.

    gpus: GPUs of a job. Each task asks for one core, and for these.
    """

    gpus: int = 0
    is_elsewhere: ClassVar[bool] = True
    _copies: Copies = field(default_factory=Copies)
    _machines: set[Machine] = field(default_factory=set)
    _said: set[str] = field(default_factory=set)

    def results(
        self, prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], limits: JobLimits
    ) -> Iterator[tuple[int, T]]:
        """Each job with its result, in the order in which they finish; see `JobEngine`."""
        import ray

        if not jobs:
            return
        content, inputs = packed(prepare)
        key, writes = uuid4().hex, None if limits.writes is None else str(limits.writes.absolute())
        batch = JobBatch(key, content, inputs, writes, code_of_advpipe(), is_command_line())
        with _marked(limits.writes, key):
            tasks = _Tasks(self, ray.put(batch), key, limits.workers)
            try:
                yield from tasks.run(jobs)
            finally:
                tasks.cancel()
                self._copies.remove()

    def slots(self) -> int:
        """How many tasks the cluster can run at a time, whoever else uses it."""
        import ray

        total = ray.cluster_resources()
        slots = int(total.get("CPU", 0))
        return min(slots, int(total.get("GPU", 0)) // self.gpus) if self.gpus else slots

    def refuse_without_slots(self) -> None:
        """Raise AdvpipeError for a cluster that can run no task."""
        if not self.slots():
            what = "GPU" if self.gpus else "core"
            hint = f"; use {option_name('device', 'cpu')}, or add one" if self.gpus else "; add one"
            raise AdvpipeError(f"the cluster has no node with a {what}{hint}")

    def note_machine(self, machine: Machine) -> None:
        """Tell the user once that the machines differ, on which the last bits of results may depend."""
        is_new = machine not in self._machines
        self._machines.add(machine)
        if is_new and len(self._machines) == 2:
            spelt = " and ".join(
                f"{each.processor} ({', '.join(each.libraries)})"
                for each in sorted(self._machines, key=lambda each: (each.processor, each.libraries))
            )
            notice(f"warning: the cluster has machines of several kinds, so last bits may differ: {spelt}")

    def say(self, outcome: Finished | Failed) -> None:
        """Print what a job said, with the name of its node; what several jobs say, once."""
        for line in outcome.lines:
            if line.is_detail:
                detail(f"{outcome.host}: {line.text}")
            elif line.text not in self._said:
                self._said.add(line.text)
                notice(f"{outcome.host}: {line.text}")
        if isinstance(outcome, Failed):
            detail(f"{outcome.host}: a job failed")

    def copies_on_node(self, missing: Missing) -> None:
        """Copy to a node what it misses, unless it is lost meanwhile."""
        import ray

        try:
            self._copies.make(missing)
        except ray.exceptions.RayError as error:
            self._copies.places.pop(missing.node_id, None)
            detail(f"{missing.host} was lost while files were copied to it: {one_line(error)}")

    def places_of_copies(self) -> Mapping[str, Mapping[str, str]]:
        """By Ray's node, the place of each copy by the driver's path."""
        return self._copies.places


class _Tasks:
    """The tasks of one call: submitted, waited for, and submitted again where their node lacked files."""

    def __init__(self, engine: RayTasks, batch: Any, key: str, workers: int | None) -> None:
        import ray

        self._engine, self._batch, self._key, self._workers = engine, batch, key, workers
        options = {"num_gpus": engine.gpus} if engine.gpus else {}
        self._task = ray.remote(_by_value(_entry)).options(num_cpus=1, max_retries=RETRIES, **options)
        self._job_of: dict[Any, int] = {}
        self._missed: Counter[int] = Counter()
        self._looked_s, self._slots, self._nodes = 0.0, 0, set[str]()
        self._had_slots_s = time.monotonic()

    def run(self, jobs: Sequence[int]) -> Iterator[tuple[int, Any]]:
        import ray

        waiting = deque(jobs)
        while waiting or self._job_of:
            self._look()
            self._fill(waiting)
            ready, _ = ray.wait(list(self._job_of), timeout=LOOK_EVERY_S) if self._job_of else ([], [])
            if not self._job_of:
                time.sleep(0.2)
            for task in ready:
                job = self._job_of.pop(task)
                self._fill(waiting)  # before the result is read, so that no worker waits for what follows
                outcome = self._outcome(task)
                if isinstance(outcome, Missing):
                    self._bring_inputs(outcome, job)
                    continue
                self._engine.say(outcome)
                if isinstance(outcome, Failed):
                    raise_error_of_worker(outcome.error)
                assert isinstance(outcome, Finished)
                self._engine.note_machine(outcome.machine)
                yield job, outcome.result

    def _fill(self, waiting: deque[int]) -> None:
        """Submit as many jobs as can run, so that no more results wait for a slow driver.

        None on top of these: Ray asks nodes that are busy for a core again and again, and where the head has
        no core, that took 7 % of two cores.
        """
        while waiting and len(self._job_of) < self._slots:
            self._submit(waiting.popleft())

    def cancel(self) -> None:
        """End the tasks that still run."""
        import ray

        for task in self._job_of:
            with suppress(ray.exceptions.RayError):
                ray.cancel(task, force=True)
        self._job_of.clear()

    def _submit(self, job: int) -> None:
        places = {node: dict(copies) for node, copies in self._engine.places_of_copies().items()}
        self._job_of[self._task.remote([self._batch], self._key, job, places, is_verbose())] = job

    def _bring_inputs(self, missing: Missing, job: int) -> None:
        """Copy to a node what the job did not find there, and submit the job again."""
        self._missed[job] += 1
        if self._missed[job] > RETRIES:
            raise AdvpipeError(
                f"the cluster's node {missing.host} does not keep its copy of {missing.inputs[0].path}; "
                "put it on a file system that all nodes share"
            )
        self._engine.copies_on_node(missing)
        self._submit(job)

    def _outcome(self, task: Any) -> Outcome:
        import ray

        try:
            outcome: Outcome | str = ray.get(task)
        except ray.exceptions.OutOfMemoryError:
            raise AdvpipeError(
                "a worker of the cluster ran out of memory several times; give its tasks more, or run fewer "
                f"at a time ({option_name('workers', 1)}); run the command again to resume"
            ) from None
        except ray.exceptions.RayError as error:
            raise AdvpipeError(
                f"a job was lost with its worker or node more than {RETRIES} times; run the command again to "
                f"resume ({one_line(str(error).strip().splitlines()[0], 300)})"
            ) from None
        if isinstance(outcome, str):
            raise AdvpipeError(f"{outcome}; install the same advpipe there: pip install 'advpipe[cluster]'")
        return outcome

    def _look(self) -> None:
        """Count now and then what the cluster has: nodes join, and nodes are lost."""
        import ray

        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_EVERY_S:
            return
        self._looked_s, slots = now_s, self._engine.slots()
        self._slots = min(slots, self._workers) if self._workers else slots
        alive = {node["NodeID"] for node in ray.nodes() if node["Alive"]}
        if lost := self._nodes - alive:
            notice(f"{counted(len(lost), 'node')} of the cluster lost; unfinished jobs run on others")
        if self._nodes != alive:
            detail(f"{counted(len(alive), 'node')} of the cluster, {counted(slots, 'task')} at a time")
        self._nodes = alive
        if slots:
            self._had_slots_s = now_s
        elif now_s - self._had_slots_s > NO_NODE_S:
            raise AdvpipeError("no node of the cluster is left; add one and run the command again to resume")


def _by_value(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, which cloudpickle sends as code: of a module of ours it would send the name."""
    own = FunctionType(function.__code__, {"__builtins__": __builtins__, "__name__": "__main__"})
    own.__module__ = "__main__"
    return own


@contextmanager
def _marked(folder: Path | None, key: str) -> Iterator[None]:
    """Keep a file with the key in the folder that workers write in, by which they recognise it."""
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    mark = key_file(folder, key)
    mark.touch()
    try:
        yield
    finally:
        mark.unlink(missing_ok=True)
