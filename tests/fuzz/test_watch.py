"""Time that a process waits for a core is not counted as a hang."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from tests.fuzz.watch import longest_wait_s, waited_s

BUSY = (
    "import os, time; os.sched_setaffinity(0, {0}); print(flush=True)\nwhile time.monotonic() < {end}: pass"
)


@pytest.mark.skipif(not os.path.exists("/proc/self/schedstat"), reason="the kernel does not count waiting")
def test_time_spent_waiting_for_a_core_is_measured() -> None:
    core, end_s = min(os.sched_getaffinity(0)), time.monotonic() + 2
    code = BUSY.replace("{0}", f"{{{core}}}").replace("{end}", str(end_s))
    both = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, start_new_session=True)
        for _ in range(2)
    ]
    for one in both:
        assert one.stdout is not None
        one.stdout.readline()
    time.sleep(max(end_s - time.monotonic() - 0.2, 0))
    waits_s = [longest_wait_s(one.pid, 0.0) for one in both]
    for one in both:
        one.kill()
        one.communicate()
    assert sum(waits_s) > 0.3  # two that are always busy, on one core
    assert longest_wait_s(both[0].pid, 0.0) == waited_s(both[0].pid) == 0.0  # it has ended
