"""SUMO as a server: the same traffic as in this process, shared with others, and gone when the drive is."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from first_words import without_progress

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages import topics
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.road_network.file import sumo_program
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic

Drive = list[dict[str, RoadUser]]
Driver = Callable[[Scenario, int], Drive]
TRACI = "traffic.transport=traci"
SMALL = ["traffic.vehicles=20", "simulation.warmup_s=2"]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def assert_same(first: Drive, second: Drive) -> None:
    for one, other in zip(first, second, strict=True):
        assert list(one) == list(other)
        for name, user in one.items():
            assert user.variant == other[name].variant
            assert np.array_equal(user.map_SE3_base, other[name].map_SE3_base)
            assert np.array_equal(user.velocity_mps, other[name].velocity_mps)


def children(pid: int) -> set[int]:
    """Processes that one has started and that still run."""
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # gone meanwhile
            continue
        if int(fields[1]) == pid and fields[0] != "Z":
            found.add(int(stat.parent.name))
    return found


def other_client(port: int, order: int, steps: int, seen: list[set[str]]) -> threading.Thread:
    """Another client of the server, which records the vehicles on the road after each step."""

    def run() -> None:
        import traci

        deadline = time.monotonic() + 60
        while True:
            try:
                client = traci.connect(port, numRetries=0)
                break
            except traci.exceptions.FatalTraCIError:
                assert time.monotonic() < deadline
                time.sleep(0.05)
        client.setOrder(order)
        for _ in range(steps):
            client.simulationStep()
            seen.append(set(client.vehicle.getIDList()))
        client.close(False)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def test_both_transports_give_the_same_traffic_over_many_steps(tmp_path: Path, drive: Driver) -> None:
    """Cars of SUMO's, one with a controller among traffic lights, and one of a table."""
    rows = "".join(f"guest,{t},{100 + 5 * t},-30,0,0,0,0,sedan\n" for t in range(12))
    (tmp_path / "t.csv").write_text("id,time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,body\n" + rows)
    settings = ["vehicles={ego: {driver: controller}, other: {}}", "sensors.lidars={}"]
    settings += [f"trajectories.file={tmp_path / 't.csv'}", *SMALL, "traffic.vehicles=60"]
    in_process, by_server = (drive(load_scenario("smoke", [*settings, *more]), 100) for more in ([], [TRACI]))
    assert_same(in_process, by_server)
    assert {"ego", "other", "guest"} <= by_server[-1].keys()
    assert len(by_server[-1]) > 40


def test_both_transports_give_the_same_bag(tmp_path: Path) -> None:
    bags = []
    for name, settings in (("libsumo", []), ("traci", [TRACI])):
        simulate(load_scenario("smoke", settings), tmp_path / name)
        messages = list(BagReader(tmp_path / name / "clean").raw_messages())
        bags.append([message for message in messages if message.topic.name != topics.SCENARIO_INFO.name])
    assert bags[0] == bags[1]
    assert len(bags[0]) > 100


def test_a_server_of_ours_is_shared(drive: Driver) -> None:
    """Another client steps it too, sees the same vehicles, and changes nothing."""
    port, seen = free_port(), list[set[str]]()
    alone = drive(load_scenario("smoke", [*SMALL, TRACI]), 20)
    server = f"traffic.server={{port: {port}, clients: 2, order: 1}}"
    thread = other_client(port, 2, 41, seen)  # 20 steps of the warm-up, one to the time 0
    shared = drive(load_scenario("smoke", [*SMALL, TRACI, server]), 20)
    thread.join(30)
    assert_same(alone, shared)
    assert set(shared[-1]) <= seen[-1]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., int]]:
    """Starts an independent SUMO server with the given options; returns its port."""
    processes = []

    def start(*options: str) -> int:
        port = free_port()
        net = load_network(load_scenario("smoke").map, tmp_path).sumo_file
        command = [sumo_program("sumo"), "--net-file", str(net), "--remote-port", str(port), "--no-step-log"]
        quiet: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        processes.append(subprocess.Popen([*command, *options], **quiet))
        return port

    yield start
    for process in processes:
        process.kill()
        process.wait()


def test_a_running_server_is_joined(started: Callable[..., int], drive: Driver) -> None:
    """With the same options it gives the same traffic; our vehicle types are defined on it."""
    scenario = load_scenario("smoke", [*SMALL, TRACI])
    options = ["--step-length", "0.1", "--seed", str(scenario.simulation.seed), "--lateral-resolution", "0.8"]
    options += ["--default.speeddev", "0.1", "--max-depart-delay", "2", "--time-to-teleport", "-1"]
    port, seen = started(*options, "--collision.action", "none", "--num-clients", "2"), list[set[str]]()
    thread = other_client(port, 1, 41, seen)
    join = f"traffic.server={{join: '127.0.0.1:{port}', order: 2}}"
    joined = drive(load_scenario("smoke", [*SMALL, TRACI, join]), 20)
    thread.join(30)
    assert_same(drive(scenario, 20), joined)
    assert len(seen) == 41


def test_a_server_with_another_step_length_is_refused(started: Callable[..., int], drive: Driver) -> None:
    join = f"traffic.server.join=127.0.0.1:{started('--step-length', '0.5')}"
    with pytest.raises(AdvpipeError, match=r"has steps of 0\.5 s, not of 0\.1 s; start it"):
        drive(load_scenario("smoke", [TRACI, join]), 1)


def test_joining_without_a_server_is_a_one_line_error(monkeypatch: pytest.MonkeyPatch, drive: Driver) -> None:
    monkeypatch.setattr("advpipe.stages.simulate.traffic.sumo.server.JOIN_TIMEOUT_S", 0.2)
    port = free_port()
    with pytest.raises(AdvpipeError, match=f"no SUMO server responds at 127.0.0.1:{port} within 0.2 s"):
        drive(load_scenario("smoke", [TRACI, f"traffic.server.join=127.0.0.1:{port}"]), 1)


def test_an_occupied_port_is_a_one_line_error(drive: Driver) -> None:
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(AdvpipeError, match=rf"traffic\.server\.port: {port} is not available"):
            drive(load_scenario("smoke", [TRACI, f"traffic.server.port={port}"]), 1)


def drive_until(scenario: Scenario, scratch: Path, what: Callable[[int], None]) -> None:
    """Steps, does something about the server, whose process id it is given, and steps again."""
    before = children(os.getpid())
    network = load_network(scenario.map, scratch)
    with SumoTraffic(scenario, network, draw_variants(np.random.default_rng(0)), scratch) as traffic:
        traffic.step()
        (sumo,) = children(os.getpid()) - before
        what(sumo)
        traffic.step()


def test_a_killed_server_is_a_one_line_error(tmp_path: Path) -> None:
    before = children(os.getpid())
    with pytest.raises(AdvpipeError, match=r"^SUMO cannot continue .*: it crashed with signal 9$"):
        drive_until(
            load_scenario("smoke", [*SMALL, TRACI]), tmp_path, lambda sumo: os.kill(sumo, signal.SIGKILL)
        )
    assert children(os.getpid()) == before


def test_an_error_of_ours_stops_the_server(tmp_path: Path) -> None:
    before = children(os.getpid())
    with pytest.raises(ZeroDivisionError):
        drive_until(load_scenario("smoke", [*SMALL, TRACI]), tmp_path, lambda sumo: print(sumo / 0))
    assert children(os.getpid()) == before


def test_ctrl_c_between_a_command_and_its_response(
    tmp_path: Path, variants: dict[str, Variant], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The response that was not read must not be taken for that of the command that closes the connection."""
    import traci

    def interrupted(_connection: object) -> None:
        monkeypatch.undo()
        raise KeyboardInterrupt

    before = children(os.getpid())
    scenario = load_scenario("smoke", [*SMALL, TRACI])
    network = load_network(scenario.map, tmp_path)
    traffic = SumoTraffic(scenario, network, variants, tmp_path).__enter__()
    monkeypatch.setattr(traci.connection.Connection, "_recvExact", interrupted)
    with pytest.raises(KeyboardInterrupt) as stopped:
        traffic.step()
    traffic.__exit__(stopped.type, stopped.value, stopped.tb)
    assert children(os.getpid()) == before


def test_a_failed_start_of_sumo_is_a_one_line_error(tmp_path: Path, variants: dict[str, Variant]) -> None:
    scenario = load_scenario("smoke", [*SMALL, TRACI])
    network = load_network(scenario.map, tmp_path)
    traffic = SumoTraffic(scenario, network, variants, tmp_path)
    (tmp_path / "vehicle_types.add.xml").write_text("<additional")
    with pytest.raises(AdvpipeError, match=r"^SUMO cannot continue .*: \S"):
        traffic.__enter__()
    assert not any("sumo" in os.readlink(f"/proc/{pid}/exe") for pid in children(os.getpid()))


def test_ctrl_c_leaves_no_server_behind(tmp_path: Path) -> None:
    program = "from advpipe.pipeline.cli import app; app()"
    command = [sys.executable, "-c", program, "simulate", "smoke", "--out", str(tmp_path / "out")]
    for setting in (TRACI, *SMALL, "simulation.duration_s=600", "environment.buildings=0"):
        command += ["--set", setting]

    def hear_ctrl_c() -> None:  # a shell's background job hands down a deaf ear
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=hear_ctrl_c)
    deadline = time.monotonic() + 120
    while not list(tmp_path.rglob("*.mcap")) and time.monotonic() < deadline:
        time.sleep(0.1)
    servers = children(process.pid)
    assert servers
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    assert without_progress(errors).strip() == "advpipe: interrupted"
    assert not [pid for pid in servers if Path(f"/proc/{pid}").exists()]
