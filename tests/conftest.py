"""Fixtures of all tests; oracles (independent programs) are required on the integration server only."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # of helpers that tests of several folders share

# Tests run in parallel processes, so more threads would only slow them down.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# For the same reason each worker of pytest-xdist keeps to one core: commands start no processes of their own
# unless a test asks for them, since every process loads the libraries anew, in three seconds.
if (worker := os.environ.get("PYTEST_XDIST_WORKER")) and hasattr(os, "sched_setaffinity"):
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[int(worker.removeprefix("gw")) % len(cores)]})

# Without bytecode, each of the hundreds of processes compiles the libraries anew, in six seconds.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Tests in the background ignore Ctrl-C, and under nohup SIGHUP; commands would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_finish() -> None:
    """Keep thousands of tests out of each collection of garbage, which takes a twentieth of the suite."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def tracebacks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder to which every command of a test, in any process, reports unexpected errors."""
    folder = tmp_path_factory.mktemp("tracebacks")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ADVPIPE_TRACEBACK_DIR", str(folder))
        yield folder


@pytest.fixture(autouse=True)
def unexpected_errors_fail(tracebacks: Path) -> Iterator[None]:
    """An unexpected error fails the test in which it happens, even a test that expects a failure."""
    yield
    found = sorted(tracebacks.glob("advpipe-error-*.txt"))
    texts = [path.read_text(encoding="utf-8") for path in found]
    for path in found:
        path.unlink()
    assert not texts, f"an unexpected error:\n{texts[0]}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, None]:
    """On the integration server, a skipped oracle test is a failure."""
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if os.environ.get("CI") and report.skipped and item.get_closest_marker("oracle"):
        report.outcome, report.longrepr = "failed", f"oracle missing: {report.longrepr[-1]}"
