"""How far jobs go past one machine: Ray beside local processes, and a killed node.

    python benchmarks/scale.py throughput          two nodes of one core beside two local workers: 3 minutes
    python benchmarks/scale.py driver --bag DRIVE  what the driver alone spends on a frame: 1 minute
    python benchmarks/scale.py killed --bag DRIVE  a node is killed in the middle of an attack: 3 minutes

All need `pip install 'advpipe[cluster]'`. What they print is in docs/scale.md. `throughput` runs both in
turn, and prints the ratio of their rates, and that of the processor time of all their processes: where both
cores are busy with nothing else, the rates are to each other as these. Drives of up to an hour:
`scale_length.py`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.messages.cloud import cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.attack.job import Job
from advpipe.stages.attack.lidar.base import unchanged

MARK = 0.9
"""The share of the local throughput that a cluster has to reach."""
RESULT_BYTES = 1_300_000
"""Of an attacked cloud of 60,000 points."""

Nodes = tuple[str, Callable[[], object]]
"""The address of a cluster, and what kills one of its nodes."""


def prepare_work(work_s: float) -> Callable[[int], bytes]:
    """A job that computes for so many seconds of processor time, and returns as much as an attacked cloud."""

    def work(job: int) -> bytes:
        begin_s = time.process_time()
        factors = np.full((200, 200), 0.5)
        while time.process_time() - begin_s < work_s:
            factors @ factors
        return bytes(RESULT_BYTES)

    return work


@dataclass(frozen=True)
class Rate:
    """Of jobs, once all workers are at work: wall time of one, and processor time of all processes."""

    wall_s: float
    cpu_s: float


def rate(jobs: int, work_s: float, workers: int | None) -> Rate:
    """The rate of jobs, from when each worker has done some to before the last one, when a worker idles."""
    begin, end, warm = (0.0, 0.0), (0.0, 0.0), max(4, jobs // 8)
    work = stream_jobs(partial(prepare_work, work_s), range(jobs), "working", workers, jobs_per_worker=1)
    for done, _ in enumerate(work, 1):
        if done == warm:
            begin = time.monotonic(), tree_cpu_s()
        elif done == jobs - 1:
            end = time.monotonic(), tree_cpu_s()
    wall_s, cpu_s = ((after - before) / (jobs - 1 - warm) for before, after in zip(begin, end, strict=True))
    return Rate(wall_s, cpu_s)


def throughput(jobs: int, work_s: float, rounds: int) -> None:
    """Prints what two nodes of one core do beside two local workers, both in turn."""
    ratios, costs = [], []
    with two_nodes() as (address, _):
        for number in range(rounds):
            with use_cluster(address):
                remote = rate(jobs, work_s, None)
            local = rate(jobs, work_s, 2)
            ratios.append(local.wall_s / remote.wall_s)
            costs.append(local.cpu_s / remote.cpu_s)
            print(
                f"round {number + 1}: local {1 / local.wall_s:.3f} jobs/s, Ray {1 / remote.wall_s:.3f} "
                f"jobs/s; processor time a job {local.cpu_s:.3f} and {remote.cpu_s:.3f} s",
                flush=True,
            )
    found = statistics.median(ratios)
    print(f"in the same processor time, Ray does {statistics.median(costs):.2f} of the work")
    print(f"Ray reaches {found:.2f} of two local workers, mark {MARK}: {'ok' if found >= MARK else 'BELOW'}")


def tree_cpu_s() -> float:
    """Processor time of this process, its children and theirs; those that have ended are left out."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            found[int(stat.parent.name)] = int(fields[1]), int(fields[11]) + int(fields[12])
    family = {os.getpid()}
    while grown := {pid for pid, (parent, _) in found.items() if parent in family} - family:
        family |= grown
    return sum(found[pid][1] for pid in family if pid in found) / os.sysconf("SC_CLK_TCK")


def driver(bag: Path, results: int) -> None:
    """Prints the processor time that the driver spends on a frame: it bounds how many workers it feeds."""
    with two_nodes() as (address, _), use_cluster(address):
        times_s = [time.process_time()]
        for _ in stream_jobs(partial(prepare_work, 0.0), range(results), "receiving"):
            times_s.append(time.process_time())
    received_s = (times_s[-1] - times_s[results // 2]) / (results - results // 2)
    frames = list(read_frames(bag, FrameSlice(0, 20)))
    with tempfile.TemporaryDirectory() as scratch:
        begin_s, job = time.process_time(), Job(Path(scratch))
        for frame in frames:
            job.store(frame.index, unchanged(frame.cloud, ""))
        stored_s = (time.process_time() - begin_s) / len(frames)
        begin_s, topic = time.process_time(), VehicleTopics("ego").lidar_points
        with BagWriter(Path(scratch, "bag"), provenance={}) as writer:
            for frame in frames:
                result = job.require(frame.index)
                writer.write_cdr(topic, cloud_to_cdr(result.cloud, frame.stamp_ns, "lidar"), frame.stamp_ns)
        written_s = (time.process_time() - begin_s) / len(frames)
    print(
        f"driver, ms of processor time a frame of {len(frames[0].cloud):,} points: "
        f"receive {1000 * received_s:.1f}, store {1000 * stored_s:.1f}, write {1000 * written_s:.1f}"
    )


def killed(bag: Path, frames: str) -> None:
    """Prints whether an attack has the same bytes after a node was killed in its middle."""
    import advpipe

    with tempfile.TemporaryDirectory() as scratch, two_nodes() as (address, kill_one):
        local, remote = Path(scratch, "local", "bag"), Path(scratch, "ray", "bag")
        options = {"type": "detach", "ratio": 0.01, "frames": frames}
        advpipe.attack(bag, out=local, workers=1, **options)
        killer = threading.Thread(target=_kill_later, args=(remote.parent, kill_one), daemon=True)
        killer.start()
        advpipe.attack(bag, out=remote, cluster=address, **options)
        killer.join(timeout=1)
        names = sorted(path.name for path in local.iterdir())
        alike = [sha256_of(local / name) == sha256_of(remote / name) for name in names]
        print(f"node killed: {not killer.is_alive()}; {sum(alike)} of {len(names)} files have the same bytes")


@contextmanager
def two_nodes() -> Iterator[Nodes]:
    """Ray's local cluster: a head without cores, and two nodes of one core."""
    from ray.cluster_utils import Cluster

    memory = 200 << 20
    head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": memory}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    nodes = [cluster.add_node(num_cpus=1, object_store_memory=memory) for _ in range(2)]
    try:
        yield cluster.address, lambda: cluster.remove_node(nodes[0], allow_graceful=False)
    finally:
        cluster.shutdown()


def _kill_later(folder: Path, kill: Callable[[], object]) -> None:
    """Kill when the first results have been stored."""
    while not [*folder.glob(".*.job/*.npz")]:
        time.sleep(0.05)
    kill()


def main() -> None:
    """Runs the named part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("part", choices=("throughput", "driver", "killed"))
    parser.add_argument("--jobs", type=int, default=40)
    parser.add_argument("--work-s", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--bag", type=Path)
    parser.add_argument("--frames", default="::10")
    given = parser.parse_args()
    if given.part == "throughput":
        throughput(given.jobs, given.work_s, given.rounds)
    elif given.part == "driver":
        driver(given.bag, 3 * given.jobs)
    else:
        killed(given.bag, given.frames)


if __name__ == "__main__":
    import scale  # under the name by which workers import it, too

    scale.main()
