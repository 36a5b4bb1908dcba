"""Artery's process around a drive, with the stand-in in its place: what goes wrong costs one line."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.run import simulate

StandIn = Callable[..., Path]

SETTINGS = [
    "v2x.network=artery",
    "simulation.duration_s=0.5",
    "simulation.warmup_s=1",
    "vehicles={}",
    "sensors={}",
    "traffic.vehicles=12",
    "traffic.pedestrians=0",
]


def scenario(program: object, *settings: str) -> Scenario:
    return load_scenario("smoke", [*SETTINGS, f"artery.program={program}", *settings])


@pytest.fixture(autouse=True)
def no_process_is_left() -> Iterator[None]:
    yield
    until_s = time.monotonic() + 5
    while (left := _children()) and time.monotonic() < until_s:
        time.sleep(0.1)
    assert not left


def _children() -> list[int]:
    return _simulators(os.getpid())


def _simulators(parent: int) -> list[int]:
    """The processes of Artery and SUMO that this process has started."""
    command = ["ps", "-ww", "-eo", "pid,ppid,args"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listed.splitlines()[1:]]
    return [
        int(pid)
        for pid, of, args in rows
        if int(of) == parent and ("standin.py" in args or "remote-port" in args)
    ]


def test_a_drive_in_lock_step_with_a_silent_artery(tmp_path: Path, standin: StandIn) -> None:
    drive = simulate(scenario(standin()), tmp_path / "drive")
    assert drive.frames == 5
    assert drive.v2x is not None
    assert drive.v2x.cams == 0


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("crash=3", "Artery ended: signal 11"),
        ("crash=14", "Artery ended: signal 11"),
        ("error=13", r"Artery ended: exit code 1: Error: Signal power is negative -- in module \(Radio\)"),
        ("after-hello=0", "Artery ended: exit code 1: Error: Cannot find the NED type"),
        ("start=0", "Artery ended: .*libINET.so"),
        ("hang=4", "Artery does not finish a step of the simulation within 3 s; raise artery.timeout_s"),
        ("hang=14", "Artery does not finish a step of the simulation within 3 s; raise artery.timeout_s"),
        ("no-hello=0", "Artery does not start within 3 s; raise artery.timeout_s"),
        ("drift=14", "Artery is at .* ns when the drive is at .* ns: their steps differ"),
        ("garbage=14", "Artery's module sent a record of 5 bytes that advpipe cannot read; build it anew"),
    ],
)
def test_a_failing_artery_costs_one_line(tmp_path: Path, standin: StandIn, fault: str, message: str) -> None:
    program = standin("--fault", fault)
    with pytest.raises(AdvpipeError, match=message) as caught:
        simulate(scenario(program, "artery.timeout_s=3"), tmp_path / "drive")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "drive").exists()


def test_a_module_of_another_version_is_refused(tmp_path: Path, standin: StandIn) -> None:
    with pytest.raises(AdvpipeError, match="version 7 of advpipe's protocol, this advpipe version 1; build"):
        simulate(scenario(standin("--protocol", "7")), tmp_path / "drive")


def test_a_missing_program_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ADVPIPE_ARTERY_BIN", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(AdvpipeError, match="needs the program advpipe-artery, which is not on the PATH"):
        simulate(load_scenario("smoke", SETTINGS), tmp_path / "drive")
    monkeypatch.setenv("ADVPIPE_ARTERY_BIN", "/nowhere/advpipe-artery")
    with pytest.raises(AdvpipeError, match="ADVPIPE_ARTERY_BIN: there is no file /nowhere/advpipe-artery"):
        simulate(load_scenario("smoke", SETTINGS), tmp_path / "drive")


def test_a_program_that_is_none_is_named(tmp_path: Path) -> None:
    text = tmp_path / "text"
    text.write_text("hello", encoding="utf-8")
    with pytest.raises(AdvpipeError, match=r"artery.program: .*text is not executable"):
        simulate(scenario(text), tmp_path / "drive")
    text.chmod(0o755)
    with pytest.raises(AdvpipeError, match="cannot be started: Exec format error"):
        simulate(scenario(text), tmp_path / "drive")


def test_a_port_in_use_is_named(tmp_path: Path, standin: StandIn) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        server = f"traffic={{transport: traci, server: {{port: {taken.getsockname()[1]}}}}}"
        with pytest.raises(AdvpipeError, match=r"traffic.server.port: \d+ is not available"):
            simulate(scenario(standin(), server), tmp_path / "drive")


def test_ctrl_c_leaves_no_process(tmp_path: Path, standin: StandIn) -> None:
    """In the warm-up, in which advpipe waits for SUMO, and SUMO for a hanging Artery."""
    arguments = [*SETTINGS, f"artery.program={standin('--fault', 'hang=4')}"]
    sets = [word for setting in arguments for word in ("--set", setting)]
    command = [sys.executable, "-m", "advpipe", "simulate", "smoke", "--out", str(tmp_path / "drive"), *sets]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until_s = time.monotonic() + 60
    while len(_simulators(process.pid)) < 2 and time.monotonic() < until_s:
        time.sleep(0.2)
    time.sleep(2)  # into the warm-up
    children = _simulators(process.pid)
    assert len(children) == 2
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert not any(Path(f"/proc/{child}").exists() for child in children)
