"""Jobs on a cluster of two nodes: what they return, what a lost node costs, and what is wrong in one line."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from two_nodes import RayCluster, can_hide_folders, ray_cluster

from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.cluster.ray_tasks import RayTasks
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_errors import UnexpectedInWorkerError
from advpipe.pipeline.core.jobs import map_jobs, stream_jobs
from advpipe.pipeline.core.verbosity import Verbosity, use_verbosity

pytestmark = pytest.mark.nightly

CODE = """
import os, time
from pathlib import Path
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.verbosity import detail, notice

def prepare(text, log, pause_s=0.0, fault=""):
    content = Path(text).read_text()
    with open(log, "a") as file:
        file.write(f"{os.getpid()}\\n")
    done = []
    def work(job):
        assert not done or job > done[-1]
        done.append(job)
        time.sleep(pause_s)
        if fault == "usage" and job == 3:
            raise UsageError("job 3 is bad")
        if fault == "bug" and job == 3:
            [].pop()
        if fault == "says":
            notice(f"something about job {job // 20}")
            print("a plug-in prints")
            detail("a detail")
        if fault == "marks":
            (Path(log).parent / f"{job}.done").touch()
        if fault == "write":
            (Path(text).parent / "out" / f"{job}.txt").write_text("x")
        return job, content
    return work
"""


@pytest.fixture(scope="module")
def cluster() -> Iterator[RayCluster]:
    with ray_cluster(2) as started:
        yield started


@pytest.fixture
def prepare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[partial[Any]]:
    """Work in a module of its own, which the workers can import; it reads a file."""
    (tmp_path / "reading.py").write_text(CODE)
    (tmp_path / "inputs").mkdir()
    (tmp_path / "inputs" / "text.txt").write_text("hello")
    monkeypatch.syspath_prepend(tmp_path)
    import reading  # type: ignore[import-not-found]

    yield partial(reading.prepare, tmp_path / "inputs" / "text.txt", str(tmp_path / "log"))
    del sys.modules["reading"]


def processes(folder: Path) -> list[str]:
    return (folder / "log").read_text().split()


def test_every_job_runs_once_and_a_worker_loads_once(
    cluster: RayCluster, prepare: partial[Any], tmp_path: Path
) -> None:
    with use_cluster(cluster.address):
        for jobs in (range(3, 33), []):
            found = map_jobs(partial(prepare, pause_s=0.1), jobs, "reading")
            assert found == [(job, "hello") for job in jobs]
    assert len(processes(tmp_path)) == len(set(processes(tmp_path))) == 2


def test_a_user_error_stays_one(cluster: RayCluster, prepare: partial[Any]) -> None:
    with use_cluster(cluster.address), pytest.raises(AdvpipeError, match=r"^job 3 is bad$"):
        map_jobs(partial(prepare, fault="usage"), range(10), "reading")


def test_an_unexpected_error_carries_its_traceback(cluster: RayCluster, prepare: partial[Any]) -> None:
    with use_cluster(cluster.address), pytest.raises(UnexpectedInWorkerError) as raised:
        map_jobs(partial(prepare, fault="bug"), range(10), "reading")
    assert "in work\n    [].pop()" in str(raised.value.__cause__)


@pytest.mark.parametrize("verbose", [False, True])
def test_what_workers_say_comes_with_the_name_of_their_node(
    cluster: RayCluster, prepare: partial[Any], capsys: pytest.CaptureFixture[str], verbose: bool
) -> None:
    """Notices, and what plug-ins print, once; details with --verbose."""
    with use_verbosity(Verbosity(verbose=verbose)), use_cluster(cluster.address):
        map_jobs(partial(prepare, fault="says"), range(40), "reading")
    said, host = capsys.readouterr().err, socket.gethostname()
    for text in ("something about job 0", "something about job 1", "a plug-in prints"):
        assert said.count(f"{host}: {text}\n") == 1
    assert said.count(f"{host}: a detail\n") == (40 if verbose else 0)


def test_a_slow_driver_gets_few_results_ahead(
    cluster: RayCluster, prepare: partial[Any], tmp_path: Path
) -> None:
    with use_cluster(cluster.address):
        results = stream_jobs(partial(prepare, fault="marks"), range(60), "reading")
        next(results)
        time.sleep(5)  # in which the workers could do all jobs
        done, slots = len([*tmp_path.glob("*.done")]), RayTasks().slots()
        next(results)
        results.close()
    assert 1 <= done <= slots + 1  # the one that was taken, and those that were submitted


def test_a_killed_node_loses_no_job(cluster: RayCluster, prepare: partial[Any]) -> None:
    doomed = cluster.add()
    found = {}
    with use_cluster(cluster.address):
        for job, result in stream_jobs(partial(prepare, pause_s=0.3), range(40), "reading"):
            assert job not in found
            found[job] = result
            if len(found) == 9:
                cluster.kill(doomed)
    assert found == {job: (job, "hello") for job in range(40)}


@pytest.mark.parametrize("verbose", [False, True])
def test_what_ray_says_of_its_nodes_is_a_detail(
    cluster: RayCluster, capsys: pytest.CaptureFixture[str], verbose: bool
) -> None:
    """Ray would print it where results go, and a JSON document with it would be none."""
    from ray._private import worker

    printing = worker.print_to_stdstream
    with use_verbosity(Verbosity(verbose=verbose)), use_cluster(cluster.address):
        lost = {"lines": ["The node has been marked dead\nsince"], "pid": "raylet", "is_err": False}
        worker.print_to_stdstream(lost, ignore_prefix=False)
    said = capsys.readouterr()
    assert said.out == ""
    assert ("Ray: The node has been marked dead since" in said.err) is verbose
    assert worker.print_to_stdstream is printing


def test_a_cluster_without_gpus(cluster: RayCluster) -> None:
    refused = pytest.raises(AdvpipeError, match=r"^the cluster has no node with a GPU; use device='cpu'")
    with refused, use_cluster(cluster.address, "cuda"):
        pass


def test_a_task_with_a_gpu_runs_where_there_is_one(cluster: RayCluster, prepare: partial[Any]) -> None:
    node = cluster.add(num_gpus=1)
    with use_cluster(cluster.address, "cuda"):
        import ray

        (slots,) = [RayTasks(gpus=1).slots()]
        assert slots == 1
        assert len(map_jobs(prepare, range(6), "reading")) == 6
        assert ray.cluster_resources()["GPU"] == 1
    cluster.kill(node)


def test_other_versions(cluster: RayCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    import ray

    monkeypatch.setattr(ray, "__version__", "2.1.0")
    words = r"^the cluster at \S+ runs Ray \d\S+ on Python \d\S+, and this program Ray 2\.1\.0 on Python"
    with pytest.raises(AdvpipeError, match=words), use_cluster(cluster.address):
        pass


def test_a_node_without_advpipe(cluster: RayCluster, prepare: partial[Any], tmp_path: Path) -> None:
    (tmp_path / "stub" / "advpipe").mkdir(parents=True)
    (tmp_path / "stub" / "advpipe" / "__init__.py").write_text("raise ImportError('no advpipe here')")
    node = cluster.add({"PYTHONPATH": str(tmp_path / "stub")})
    refused = pytest.raises(AdvpipeError, match=r"cannot load advpipe \(no advpipe here\); install the same")
    with use_cluster(cluster.address), refused:
        map_jobs(partial(prepare, pause_s=0.5), range(60), "reading")
    cluster.kill(node)


@pytest.mark.skipif(not can_hide_folders(), reason="this user may not mount")
def test_a_node_that_does_not_see_the_input(prepare: partial[Any], tmp_path: Path) -> None:
    """It gets a copy to read; a folder to write in must be shared."""
    with ray_cluster(0) as alone:
        alone.add_without(tmp_path / "inputs")
        deadline = time.monotonic() + 150  # a node starts in seconds, but not on a busy machine
        while time.monotonic() < deadline:
            try:
                with use_cluster(alone.address):
                    assert map_jobs(prepare, range(8), "reading") == [(job, "hello") for job in range(8)]
                    assert not [*Path("/tmp").glob("advpipe-inputs-*")]
                    refused = pytest.raises(
                        AdvpipeError, match=r"does not see \S+; write to a folder that all"
                    )
                    with refused:
                        shared = tmp_path / "inputs" / "out"
                        for _ in stream_jobs(prepare, range(8), "reading", writes=shared):
                            pass
                    assert not os.listdir(shared)
                return
            except AdvpipeError as error:
                if "no node with a core" not in str(error):
                    raise
                time.sleep(0.5)  # the node is starting
        pytest.fail("the node did not start")
