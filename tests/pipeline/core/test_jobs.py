"""Jobs: each runs once, in whichever process; failures and dead workers are reported, and orphans end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_errors import UnexpectedInWorkerError
from advpipe.pipeline.core.jobs import Work, map_jobs, run_jobs
from advpipe.pipeline.core.local_processes import results_ahead

CODE = """
import os, time
from pathlib import Path
from advpipe.pipeline.core.errors import AdvpipeError

def prepare(folder, fault):
    (folder / f"process-{os.getpid()}").touch()
    def work(job):
        if job == fault == 5:
            raise AdvpipeError("job 5 is bad")
        if job == fault == 6:
            os._exit(1)
        if job == fault == 9:
            [].pop()
        if job == fault == 8:
            open(folder / "nowhere" / "a")
        if fault == 7:
            time.sleep(0.2)
        with (folder / f"{job}.txt").open("a") as file:
            file.write(str(job * job))
        return job * job
    return work
"""


@pytest.fixture
def prepare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> partial[Work]:
    """Work in a module of its own, which the worker processes can import."""
    (tmp_path / "squares.py").write_text(CODE)
    (tmp_path / "out").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    import squares  # type: ignore[import-not-found]

    yield partial(squares.prepare, tmp_path / "out")
    del sys.modules["squares"]


def results(folder: Path) -> dict[str, str]:
    return {path.stem: path.read_text() for path in (folder / "out").glob("*.txt")}


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_runs_once(prepare: partial[Work], tmp_path: Path, workers: int) -> None:
    run_jobs(partial(prepare, None), range(3, 15), "squares", workers)
    assert results(tmp_path) == {str(job): str(job * job) for job in range(3, 15)}
    assert len(list((tmp_path / "out").glob("process-*"))) == workers


@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_in_the_order_of_the_jobs(prepare: partial[Work], workers: int) -> None:
    jobs = range(3, 15)
    assert map_jobs(partial(prepare, None), jobs, "squares", workers) == [job * job for job in jobs]
    assert map_jobs(partial(prepare, None), [], "squares", workers) == []


def test_another_process_is_ahead_and_its_errors_come_in_their_place(
    prepare: partial[Work], tmp_path: Path
) -> None:
    found = results_ahead(partial(prepare, 5), range(10))
    assert [next(found) for _ in range(5)] == [0, 1, 4, 9, 16]
    with pytest.raises(AdvpipeError, match="job 5 is bad"):
        next(found)
    assert [path.name for path in (tmp_path / "out").glob("process-*")] != [f"process-{os.getpid()}"]


def test_who_has_enough_ends_the_process_that_is_ahead(prepare: partial[Work], tmp_path: Path) -> None:
    found = results_ahead(partial(prepare, 7), range(1000))
    assert next(found) == 0
    found.close()
    (process,) = (int(path.name.partition("-")[2]) for path in (tmp_path / "out").glob("process-*"))
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system ties no process to a core")
def test_no_more_processes_than_cores(prepare: partial[Work], tmp_path: Path) -> None:
    """Of those that this process may use: batch systems lend some of a machine's."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        run_jobs(partial(prepare, None), range(12), "squares")
    finally:
        os.sched_setaffinity(0, before)
    assert [path.name for path in (tmp_path / "out").glob("process-*")] == [f"process-{os.getpid()}"]


def test_few_jobs_start_no_process(prepare: partial[Work], tmp_path: Path) -> None:
    run_jobs(partial(prepare, None), [1, 2], "squares", 2)
    assert (tmp_path / "out" / f"process-{os.getpid()}").exists()


def test_without_jobs_nothing_is_loaded(prepare: partial[Work], tmp_path: Path) -> None:
    run_jobs(partial(prepare, None), [], "squares")
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("workers", [1, 2])
def test_a_usage_error_of_a_worker_is_raised_as_one(prepare: partial[Work], workers: int) -> None:
    with pytest.raises(AdvpipeError, match=r"^job 5 is bad$"):
        run_jobs(partial(prepare, 5), range(10), "squares", workers)


def test_an_os_error_of_a_worker_is_one_line(prepare: partial[Work]) -> None:
    with pytest.raises(AdvpipeError, match=r"nowhere/a: No such file or directory$"):
        run_jobs(partial(prepare, 8), range(10), "squares", 2)


def test_a_dead_worker_is_reported(prepare: partial[Work]) -> None:
    with pytest.raises(AdvpipeError, match="a worker process died"):
        run_jobs(partial(prepare, 6), range(10), "squares", 2)


def test_an_unexpected_error_carries_the_workers_traceback(prepare: partial[Work]) -> None:
    with pytest.raises(
        UnexpectedInWorkerError, match=r"^IndexError: pop from .* \(in a worker process\)$"
    ) as raised:
        run_jobs(partial(prepare, 9), range(10), "squares", 2)
    assert "in work\n    [].pop()" in str(raised.value.__cause__)


PARENT = """
import sys
from functools import partial
from pathlib import Path
import squares
from advpipe.pipeline.core.jobs import run_jobs
from advpipe.pipeline.core import signals
from advpipe.pipeline.process.failures import report_failure

if __name__ == "__main__":
    signals.install()
    try:
        run_jobs(partial(squares.prepare, Path("out"), 7), range(1000), "", 2)
    except BaseException as error:
        sys.exit(report_failure(error))
"""


def parent_of_workers(folder: Path) -> subprocess.Popen[str]:
    """In a process group of its own, as a terminal's job is."""
    (folder / "parent.py").write_text(PARENT)
    command = [sys.executable, "parent.py"]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)


needs_proc = pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")


@needs_proc
@pytest.mark.usefixtures("prepare")
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with parent_of_workers(tmp_path) as parent:
        wait_until(lambda: len(list(out.glob("*.txt"))) >= 2)
        workers = [int(path.name.split("-")[1]) for path in out.glob("process-*")]
        assert len(workers) == 2
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        wait_until(lambda: not any(map(is_alive, workers)))
        assert not any(map(is_alive, workers))
        assert parent.communicate()[1] == ""


@needs_proc
@pytest.mark.usefixtures("prepare")
@pytest.mark.parametrize(
    ("number", "line"),
    [
        (signal.SIGINT, "advpipe: interrupted\n"),
        (signal.SIGTERM, "advpipe: terminated\n"),
        (signal.SIGHUP, "advpipe: hung up\n"),
    ],
)
@pytest.mark.parametrize("to_all", [False, True], ids=["parent", "group"])
def test_a_signal_ends_all_processes_with_one_line(
    tmp_path: Path, number: signal.Signals, line: str, to_all: bool
) -> None:
    """While the workers start, and while they work; whether only the parent gets it or, as by ctrl-C, all."""
    for is_reached in (
        lambda: is_child_there(parent.pid),
        lambda: len(list((tmp_path / "out").glob("process-*"))) == 2,
    ):
        with parent_of_workers(tmp_path) as parent:
            wait_until(is_reached)
            (os.killpg if to_all else os.kill)(parent.pid, number)
            assert parent.communicate(timeout=60)[1] == line
        assert parent.returncode == 128 + number
        for path in (tmp_path / "out").glob("process-*"):
            assert not is_alive(int(path.name.split("-")[1]))
            path.unlink()


def is_child_there(pid: int) -> bool:
    return bool(Path(f"/proc/{pid}/task/{pid}/children").read_text().strip())


def wait_until(reached: Callable[[], bool], patience_s: float = 60) -> None:
    """Returns when it is so, or when patience is at an end: the caller asserts."""
    deadline = time.monotonic() + patience_s
    while not reached() and time.monotonic() < deadline:
        time.sleep(0.05)


def is_alive(pid: int) -> bool:
    """Whether a process still runs; one that only waits to be reaped does not."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
