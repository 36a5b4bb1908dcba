"""How far jobs go past one machine: Ray beside local processes, a killed node, and drives of an hour.

    python benchmarks/scale.py throughput          two nodes of one core beside two local workers: 3 minutes
    python benchmarks/scale.py driver --bag DRIVE  what the driver alone spends on a frame: 1 minute
    python benchmarks/scale.py killed --bag DRIVE  a node is killed in the middle of an attack: 3 minutes
    python benchmarks/scale.py length              cost of a frame in drives of 100 to 30,000: 5 minutes;
                                                  with --jobs 30000 all of them are attacked: an hour

All but `length` need `pip install 'advpipe[cluster]'`. What they print is in docs/scale.md.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import SCENARIO_INFO, TF_STATIC, VehicleTopics
from advpipe.stages.attack.job import Job
from advpipe.stages.attack.lidar.base import unchanged

MARK = 0.9
"""The share of the local throughput that a cluster has to reach."""
RESULT_BYTES = 1_300_000
"""Of an attacked cloud of 60,000 points."""

START_NS, PERIOD_NS = 1_767_268_800_000_000_000, 100_000_000
SPLIT_S = 60.0

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


def seconds_a_job(jobs: int, work_s: float, workers: int | None) -> float:
    """Wall time between results, once all workers are at work."""
    times_s = []
    for _ in stream_jobs(partial(prepare_work, work_s), range(jobs), "working", workers, jobs_per_worker=1):
        times_s.append(time.monotonic())
    warm = max(4, jobs // 8)
    return (times_s[-1] - times_s[warm]) / (len(times_s) - 1 - warm)


def throughput(jobs: int, work_s: float, rounds: int) -> None:
    """Prints what two nodes of one core do beside two local workers."""
    ratios = []
    with two_nodes() as (address, _):
        for number in range(rounds):
            with use_cluster(address):
                ray_s = seconds_a_job(jobs, work_s, None)
            local_s = seconds_a_job(jobs, work_s, 2)
            ratios.append(local_s / ray_s)
            print(f"round {number + 1}: local {1 / local_s:.3f} jobs/s, Ray {1 / ray_s:.3f} jobs/s")
    ratio = statistics.median(ratios)
    print(f"Ray reaches {ratio:.2f} of two local workers, mark {MARK}: {'ok' if ratio >= MARK else 'BELOW'}")


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


def length(counts: list[int], attacked: int) -> None:
    """Prints processor time and memory for each length of drive, in a process of its own."""
    for count in counts:
        command = [sys.executable, __file__, "one-length", "--jobs", str(attacked), "--counts", str(count)]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        found = json.loads(done.stdout.splitlines()[-1])
        times = ", ".join(f"{name} {value:.2f} ms" for name, value in found["ms"].items())
        print(
            f"{count:6,} frames, {found['files']:2} files: {times}; peak {found['peak_mb']:.0f} MB",
            flush=True,
        )


def one_length(count: int, attacked: int) -> None:
    """Records a drive of small clouds in files of a minute, reads frames all over it, and attacks some.

    Milliseconds of processor time: of writing a frame, of opening the bag, of reading one frame as a job
    does, and of attacking one.
    """
    import advpipe

    spent_ms, step = {}, max(1, count // attacked)
    with tempfile.TemporaryDirectory() as scratch:
        drive = Path(scratch, "drive")
        begin_s = time.process_time()
        write_drive(drive, count)
        spent_ms["write"] = 1000 * (time.process_time() - begin_s) / count
        begin_s = time.process_time()
        reader = BagReader(drive)
        reader.log_times_ns(VehicleTopics("ego").lidar_points.name)
        spent_ms["open"] = 1000 * (time.process_time() - begin_s)
        begin_s, read = time.process_time(), range(0, count, max(1, count // 100))
        for frame in read:
            next(read_frames(reader, FrameSlice(frame, frame + 1)))
        spent_ms["read"] = 1000 * (time.process_time() - begin_s) / len(read)
        advpipe.attack(drive, recipe="random", frames="0", workers=1, out=Path(scratch, "warm"))
        begin_s = time.process_time()
        out = Path(scratch, "attacked")
        advpipe.attack(drive, recipe="random", ratio=0.1, frames=f"::{step}", workers=1, out=out)
        spent_ms["attack"] = 1000 * (time.process_time() - begin_s) / len(range(0, count, step))
        files = len(list(drive.glob("*.mcap")))
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"ms": spent_ms, "files": files, "peak_mb": peak_mb}))


def write_drive(path: Path, count: int) -> None:
    """A drive at 10 Hz of a car 20 m ahead: 600 points a cloud, in files of `SPLIT_S`."""
    ego, draw = VehicleTopics("ego"), np.random.default_rng(1)
    box = Boxes(np.array([[20.0, 0.0, -1.0, 4.5, 1.9, 1.6, 0.0]]), np.array([0]), ("veh1",), np.zeros((1, 3)))
    record = clean_provenance("scale", f"recording: {{split_s: {SPLIT_S}}}\n", 1, "0" * 64)
    mount = se3_from_yaw([0.0, 0.0, 1.8], 0.0)
    with BagWriter(path, provenance=record, split=BagSplit(SPLIT_S)) as bag:
        bag.write(TF_STATIC, build.transforms(START_NS, [(ego.base_frame, ego.lidar_frame, mount)]), START_NS)
        bag.write(SCENARIO_INFO, build.string("{}"), START_NS)
        for frame in range(count):
            stamp_ns = START_NS + frame * PERIOD_NS
            cloud = np.zeros(600, POINT_DTYPE)
            cloud["x"] = draw.uniform(18, 22, 600)
            cloud["y"], cloud["z"] = draw.uniform(-1, 1, 600), draw.uniform(-1.8, -0.2, 600)
            pose = build.odometry(stamp_ns, se3_from_yaw([frame, 0, 0], 0.0), [10.0, 0, 0], [0, 0, 0])
            bag.write(ego.objects, build.detections_message(stamp_ns, ego.lidar_frame, box), stamp_ns)
            bag.write(ego.true_odometry, pose, stamp_ns)
            bag.write_cdr(ego.lidar_points, cloud_to_cdr(cloud, stamp_ns, ego.lidar_frame), stamp_ns)


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
    parser.add_argument("part", choices=("throughput", "driver", "killed", "length", "one-length"))
    parser.add_argument("--jobs", type=int, default=40)
    parser.add_argument("--work-s", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--bag", type=Path)
    parser.add_argument("--frames", default="::10")
    parser.add_argument("--counts", type=int, nargs="+", default=[100, 1000, 10_000, 30_000])
    given = parser.parse_args()
    if given.part == "throughput":
        throughput(given.jobs, given.work_s, given.rounds)
    elif given.part == "driver":
        driver(given.bag, 3 * given.jobs)
    elif given.part == "killed":
        killed(given.bag, given.frames)
    elif given.part == "length":
        length(given.counts, given.jobs)
    else:
        one_length(given.counts[0], given.jobs)


if __name__ == "__main__":
    import scale  # under the name by which workers import it, too

    scale.main()
