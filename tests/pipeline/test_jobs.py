"""Jobs: each runs once, whichever process runs it; failures and deaths are said, orphans end."""

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

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.jobs import Work, map_jobs, run_jobs

CODE = """
import os, time
from pathlib import Path
from advpipe.pipeline.errors import AdvpipeError

def prepare(folder, fault):
    (folder / f"process-{os.getpid()}").touch()
    def work(job):
        if job == fault == 5:
            raise AdvpipeError("job 5 is bad")
        if job == fault == 6:
            os._exit(1)
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
def test_results_come_in_the_order_of_the_jobs(prepare: partial[Work], workers: int) -> None:
    jobs = range(3, 15)
    assert map_jobs(partial(prepare, None), jobs, "squares", workers) == [job * job for job in jobs]
    assert map_jobs(partial(prepare, None), [], "squares", workers) == []


def test_few_jobs_start_no_process(prepare: partial[Work], tmp_path: Path) -> None:
    run_jobs(partial(prepare, None), [1, 2], "squares", 2)
    assert (tmp_path / "out" / f"process-{os.getpid()}").exists()


def test_no_jobs_load_nothing(prepare: partial[Work], tmp_path: Path) -> None:
    run_jobs(partial(prepare, None), [], "squares")
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("workers", [1, 2])
def test_a_users_mistake_comes_back_as_itself(prepare: partial[Work], workers: int) -> None:
    with pytest.raises(AdvpipeError, match=r"^job 5 is bad$"):
        run_jobs(partial(prepare, 5), range(10), "squares", workers)


def test_what_the_system_refuses_a_worker_is_one_line(prepare: partial[Work]) -> None:
    with pytest.raises(AdvpipeError, match=r"nowhere/a: No such file or directory$"):
        run_jobs(partial(prepare, 8), range(10), "squares", 2)


def test_a_worker_that_dies_is_said(prepare: partial[Work]) -> None:
    with pytest.raises(AdvpipeError, match="a worker process died"):
        run_jobs(partial(prepare, 6), range(10), "squares", 2)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
def test_workers_end_with_a_parent_that_is_killed(prepare: partial[Work], tmp_path: Path) -> None:
    code = (
        "from functools import partial; from pathlib import Path; import squares\n"
        "from advpipe.pipeline.jobs import run_jobs\n"
        "if __name__ == '__main__':\n"
        f"    folder = Path({str(tmp_path / 'out')!r})\n"
        "    run_jobs(partial(squares.prepare, folder, 7), range(1000), '', 2)\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    parent = subprocess.Popen([sys.executable, str(script)], cwd=tmp_path)
    out = tmp_path / "out"
    wait_until(lambda: len(list(out.glob("*.txt"))) >= 2)
    workers = [int(path.name.split("-")[1]) for path in out.glob("process-*")]
    assert len(workers) == 2
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    wait_until(lambda: not any(map(is_alive, workers)))
    assert not any(map(is_alive, workers))


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
