"""`advpipe play` as users run it, seen from other processes."""

import contextlib
import json
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from dds_process import dds_subscriber, new_domain
from first_words import without_progress
from websockets.sync.client import connect

from advpipe.commands.play import play
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import use_flags
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.messages.build import clock
from advpipe.pipeline.messages.topics import CLOCK

SAMPLE = str(shipped_sample() / "clean")
PLAY = [sys.executable, "-m", "advpipe", "play"]


@contextlib.contextmanager
def playing(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    with subprocess.Popen([*PLAY, *arguments], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for_address(process: subprocess.Popen[str]) -> str:
    assert process.stderr is not None
    while "ws://" not in (line := process.stderr.readline()):
        assert line, process.communicate()
    return line.partition("played to ")[2].partition(";")[0]


@pytest.mark.oracle
def test_a_bag_to_ros_2() -> None:
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    topics = [("rt/clock", "clock", "best_effort"), ("rt/ego/lidar/points", "cloud", "reliable")]
    with dds_subscriber(domain, *topics) as seen:
        where = ["--ros2", "--domain", str(domain), "--interface", "lo", "--delay", "3"]
        done = subprocess.run([*PLAY, SAMPLE, *where, "--json"], capture_output=True, text=True)
        samples, publications = seen()
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    recorded = BagReader(Path(SAMPLE)).topics
    messages = sum(topic.count for topic in recorded.values())
    assert (said["messages"], said["missed"], said["loops"]) == (messages, 0, 1)
    assert said["recorded_s"] == pytest.approx(0.2, abs=0.01)
    assert [sum(one["topic"] == name for one in samples) for name, *_ in topics] == [3, 3]
    assert len(publications) == len(said["topics"]) == len(recorded) > 15


@pytest.mark.oracle
def test_a_bag_to_foxglove_again_and_again_until_it_is_stopped() -> None:
    """Signals end it as at its end; the viewer sees recorded time, and jumps back."""
    pytest.importorskip("foxglove")
    with playing(SAMPLE, "--foxglove", "--port", "0", "--loop", "--rate", "2", "--delay", "0.2") as process:
        url = wait_for_address(process)
        with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:  # type: ignore[list-item]
            channels: list[dict[str, object]] = []
            while len(channels) < len(BagReader(Path(SAMPLE)).topics):
                channels += json.loads(viewer.recv(timeout=20)).get("channels", [])
            (wanted,) = [one["id"] for one in channels if one["topic"] == "/ego/lidar/points"]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": wanted}]}))
            times_ns: list[int] = []
            while len(times_ns) < 7:
                data = viewer.recv(timeout=20)
                assert isinstance(data, bytes)
                if data[0] == 1:
                    times_ns.append(struct.unpack_from("<Q", data, 5)[0])
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=30)
    expected = BagReader(Path(SAMPLE)).log_times_ns("/ego/lidar/points").tolist()
    start = expected.index(times_ns[0])
    assert times_ns == [expected[(start + number) % 3] for number in range(7)]
    assert process.returncode == 0, errors
    assert "loops; late by" in out


@pytest.mark.oracle
def test_a_slow_subscriber_is_one_line_and_is_counted() -> None:
    """One that takes a single message, and then sleeps."""
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    where = ["--ros2", "--domain", str(domain), "--interface", "lo", "--delay", "2", "--loop"]
    with (
        dds_subscriber(domain, ("rt/ego/lidar/points", "cloud", "reliable"), slow_s=60),
        playing(SAMPLE, *where, "--topics", "/ego/lidar/points", "--json") as process,
    ):
        time.sleep(10)
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=30)
    (line,) = [line for line in errors.splitlines() if "too slow" in line]
    assert line.startswith("/ego/lidar/points: a reliable subscriber is too slow, or gone: ")
    said = json.loads(out)
    clouds = next(one for one in said["topics"] if one["topic"] == "/ego/lidar/points")
    assert 10 < clouds["missed"] == said["missed"] < clouds["messages"]


@pytest.mark.oracle
def test_a_slow_viewer_is_one_line() -> None:
    """One that subscribes, and then reads nothing; it does not hold up the end."""
    pytest.importorskip("foxglove")
    where = ["--foxglove", "--port", "0", "--loop", "--rate", "20", "--topics", "/ego/lidar/points"]
    with playing(SAMPLE, *where) as process:
        url = wait_for_address(process)
        with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:  # type: ignore[list-item]
            channels: list[dict[str, object]] = []
            while len(channels) < 2:
                channels += json.loads(viewer.recv(timeout=20)).get("channels", [])
            (wanted,) = [one["id"] for one in channels if one["topic"] == "/ego/lidar/points"]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": wanted}]}))
            assert process.stderr is not None
            while "a viewer is too slow" not in (line := process.stderr.readline()):
                assert line, process.communicate()
            process.send_signal(signal.SIGINT)
            begin_s = time.monotonic()
            out, _ = process.communicate(timeout=30)
            assert time.monotonic() - begin_s < 15
    assert line.startswith("Foxglove: a viewer is too slow (outbox for client 127.0.0.1:")
    assert out.rstrip().endswith("; a slow viewer missed some")


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Without QoS, and with a type that DDS cannot carry."""
    plain = Topic("/clock", CLOCK.type, ())
    with BagWriter(tmp_path / "clean", provenance={"kind": "clean"}) as writer:
        writer.write(CLOCK, clock(5), 5)
    (tick,) = BagReader(tmp_path / "clean").raw_messages()
    with BagWriter(tmp_path / "foreign", provenance={"kind": "clean"}) as writer:
        writer.copy(RawMessage(plain, tick.schema, tick.cdr, 5, 5, 0))
        wide = Topic("/wide", "our_msgs/msg/Wide", ())
        writer.copy(RawMessage(wide, "wstring text", b"\0\1\0\0\0\0\0\0", 5, 5, 0))
    return tmp_path / "foreign"


def test_a_bag_without_qos_and_a_type_that_cannot_be_published(foreign: Path) -> None:
    pytest.importorskip("cyclonedds")
    where = ["--ros2", "--domain", str(new_domain()), "--interface", "lo", "--delay", "0"]
    done = subprocess.run([*PLAY, str(foreign), *where], capture_output=True, text=True)
    assert done.returncode == 0
    without, left_out, ready = without_progress(done.stderr).splitlines()
    assert without.startswith("the bag states no QoS for 2 topics; ROS 2's default is offered")
    assert left_out == (
        "/wide cannot be published to ROS 2: our_msgs/msg/Wide: its field text is a wstring; it is left out"
    )
    assert "is played to ROS 2 domain" in ready
    assert "1 message on 1 topic" in done.stdout


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"ros2": False}, "nobody would see the bag; give --ros2, --foxglove or both"),
        ({"interface": "nix0"}, "this machine has no network interface nix0"),
        ({"rate": 0.0}, "--rate is 0, but must be from 0.001 to 100"),
        ({"start_s": 9.0}, f"{SAMPLE}: nothing is left to play; it has 0.2 s, choose a smaller --start"),
    ],
)
def test_refusals_are_one_line(options: dict[str, Any], line: str) -> None:
    pytest.importorskip("cyclonedds")
    with use_flags(), pytest.raises(UsageError) as found:
        play(SAMPLE, **{"ros2": True, **options})
    assert str(found.value).startswith(line)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("option", "package"),
    [("--ros2", "cyclonedds"), pytest.param("--foxglove", "foxglove-sdk", marks=pytest.mark.nightly)],
)
def test_a_missing_extra_is_one_line(option: str, package: str, tmp_path: Path) -> None:
    """A module of that name that is not there: imports fail as without the extra."""
    module = package.partition("-")[0]
    (tmp_path / "sitecustomize.py").write_text(f"import sys; sys.modules[{module!r}] = None\n")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([*PLAY, SAMPLE, option], capture_output=True, text=True, env=environment)
    extra = option.removeprefix("--")
    assert done.returncode == 1
    said = without_progress(done.stderr)
    assert said.startswith(f"advpipe: the Python package {package} is missing (no module {module}")
    assert said.endswith(f"install it: pip install 'advpipe[{extra}]'\n")
    assert said.count("\n") == 1


def test_no_usable_interface_is_one_line() -> None:
    """In a network namespace of its own, where even the loopback is down."""
    pytest.importorskip("cyclonedds")
    inside = ["unshare", "--user", "--map-root-user", "--net"]
    if subprocess.run([*inside, "true"], capture_output=True).returncode:
        pytest.skip("no network namespaces here")
    command = [*inside, *PLAY, SAMPLE, "--ros2", "--domain", "9"]
    begin_s = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True)
    assert time.monotonic() - begin_s < 60
    assert done.returncode == 1
    said = without_progress(done.stderr)
    assert said.startswith("advpipe: DDS domain 9 cannot be joined on a network interface: ")
    assert said.count("\n") == 1
