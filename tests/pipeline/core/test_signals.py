"""Signals end a command in one line, with its code, at any moment; what it began is cleaned up."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from first_words import without_progress

ENDINGS = {
    signal.SIGINT: "advpipe: interrupted\n",
    signal.SIGTERM: "advpipe: terminated\n",
    signal.SIGHUP: "advpipe: hung up\n",
}
pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="looks at handlers in /proc")


def started(*arguments: str, folder: Path) -> subprocess.Popen[str]:
    """The command, as soon as its handlers are installed: before that, it is Python that starts."""
    process = subprocess.Popen(
        [sys.executable, "-m", "advpipe", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    handled = 1 << (signal.SIGALRM - 1)
    while not caught(process.pid) & handled:
        assert process.poll() is None
        time.sleep(0.001)
    return process


def caught(pid: int) -> int:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("SigCgt")).split()[1], 16)


MOMENTS_S = (0, 0.05, 0.15, 0.3, 0.6, 1.2, 2.5, 4)


@pytest.mark.parametrize(
    ("number", "moments_s"),
    [
        (signal.SIGINT, MOMENTS_S[:-1]),
        (signal.SIGTERM, (0.3, 1.2)),
        (signal.SIGHUP, (0.3, 1.2)),
        *(pytest.param(number, MOMENTS_S, marks=pytest.mark.nightly) for number in ENDINGS),
    ],
)
def test_a_signal_at_any_moment_of_the_start_ends_the_command_cleanly(
    tmp_path: Path, number: signal.Signals, moments_s: tuple[float, ...]
) -> None:
    """Imports of the command line, of its libraries, the network, the first frames of ten minutes."""
    arguments = ["simulate", "smoke", "--set", "simulation.duration_s=600"]
    for moment_s in moments_s:
        with started(*arguments, folder=tmp_path) as process:
            time.sleep(moment_s)
            process.send_signal(number)
            out, errors = process.communicate(timeout=120)
        ending = (process.returncode, out, without_progress(errors))
        assert ending == (128 + number, "", ENDINGS[number]), moment_s
        assert list(tmp_path.iterdir()) == [], moment_s


def test_signals_ignored_by_nohup_stay_ignored(tmp_path: Path) -> None:
    command = ["nohup", sys.executable, "-m", "advpipe", "schema", "--out", "schema.json"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL
    ) as process:
        while not caught(process.pid) & (1 << (signal.SIGALRM - 1)):
            assert process.poll() is None
            time.sleep(0.001)
        process.send_signal(signal.SIGHUP)
        process.communicate(timeout=120)
    assert process.returncode == 0
    assert (tmp_path / "schema.json").is_file()


def run_code(tmp_path: Path, code: str) -> subprocess.CompletedProcess[str]:
    script = tmp_path / "script.py"
    script.write_text(
        "import os, signal, sys, time\n"
        "from advpipe.pipeline.core import signals\n"
        "from advpipe.pipeline.process.failures import report_failure\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "__name__ = 'advpipe.stages.busy'\n"
        f"{code}"
    )
    return subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60)


def test_an_import_during_work_is_not_interrupted(tmp_path: Path) -> None:
    """This library would swallow the exception, as libraries that try one import after another do."""
    (tmp_path / "swallowing.py").write_text(
        "import os, signal, time\n"
        "try:\n    os.kill(os.getpid(), signal.SIGTERM); time.sleep(0.1)\n"
        "except BaseException:\n    print('broken off')\n"
        "print('loaded')\n"
    )
    done = run_code(
        tmp_path,
        "signals.install()\n"
        "try:\n    import swallowing; time.sleep(30)\n"
        "except BaseException as error:\n"
        "    print('cleaned up', flush=True); sys.exit(report_failure(error))\n",
    )
    assert (done.returncode, done.stdout, done.stderr) == (
        143,
        "loaded\ncleaned up\n",
        "advpipe: terminated\n",
    )


def test_a_signal_in_a_destructor_is_raised_later(tmp_path: Path) -> None:
    done = run_code(
        tmp_path,
        "class Slow:\n"
        "    def __del__(self):\n        os.kill(os.getpid(), signal.SIGHUP); time.sleep(0.01)\n"
        "signals.install()\n"
        "try:\n    Slow(); time.sleep(30)\n"
        "except BaseException as error:\n    sys.exit(report_failure(error))\n",
    )
    assert (done.returncode, done.stderr) == (129, "advpipe: hung up\n")


def test_an_error_of_a_library_after_a_signal_counts_as_the_signal(tmp_path: Path) -> None:
    done = run_code(
        tmp_path,
        "signals.install()\n"
        "try:\n"
        "    try:\n        os.kill(os.getpid(), signal.SIGINT); time.sleep(30)\n"
        "    except BaseException:\n        raise SystemError('returned a result with an error')\n"
        "except BaseException as error:\n    sys.exit(report_failure(error))\n",
    )
    assert (done.returncode, done.stderr) == (130, "advpipe: interrupted\n")


@pytest.mark.parametrize("number", ENDINGS)
def test_a_deferred_signal_is_noted_and_raised_on_request(number: signal.Signals) -> None:
    from advpipe.pipeline.core.signals import Stopped, deferred

    before = [signal.getsignal(one) for one in ENDINGS]
    with deferred() as stopped:
        stopped.raise_if_set()
        os.kill(os.getpid(), number)
        assert stopped.is_set()
    with pytest.raises(KeyboardInterrupt) as raised:
        stopped.raise_if_set()
    assert raised.type is Stopped
    assert raised.value.number == number
    assert [signal.getsignal(one) for one in ENDINGS] == before


WHOLE_BLOCK = """
from threading import Event, Thread

signals.install()
begun, over = Event(), Event()
Thread(target=over.wait, daemon=True).start()  # it may take signals that the main thread blocks
try:
    with signals.blocked():
        {arrives}
        for _ in range(20):
            time.sleep(0.005)
        print("whole", flush=True)
    time.sleep(5)
except signals.Stopped as stopped:
    print(stopped, flush=True)
"""


@pytest.mark.parametrize(
    "arrives",
    [
        "os.kill(os.getpid(), signal.SIGTERM)",
        "signals._received = signal.SIGTERM; signals._wait()",  # as one that came during an import
    ],
)
def test_a_block_is_not_interrupted(arrives: str, tmp_path: Path) -> None:
    """A process that is started there would print a traceback if this one stopped in the middle of it."""
    done = run_code(tmp_path, WHOLE_BLOCK.format(arrives=arrives))
    assert (done.returncode, done.stdout, done.stderr) == (0, "whole\nterminated\n", "")
