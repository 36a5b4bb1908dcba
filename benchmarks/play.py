"""Counts what subscribers receive of a bag that `advpipe play` plays, and how late messages are.

    python benchmarks/play.py [--points 80000] [--seconds 10] [--rounds 1]

A drive of random clouds of so many points at 10 Hz, with 100 small messages a second beside them, is played
on the loopback interface to a reliable and a best-effort DDS subscriber at once, then to a WebSocket client:
each a process of its own that takes the bytes and counts. Exit code 1 where a reliable subscriber or the
client misses a cloud, or the best-effort one more than 2 %.

The subscribers' socket buffers are 4 MB, as docs/live.md says how to set them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from common import finish, machine, scratch

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages.build import clock, string
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import CLOCK, SOURCE_FRAME, VehicleTopics
from advpipe.stages.play.options import PlayOptions
from advpipe.stages.play.run import play

DOMAIN = 87
BEST_EFFORT_LOSS = 0.02
CLOUDS = VehicleTopics().lidar_points

CONFIGURATION = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/>
</Interfaces></General><Internal><SocketReceiveBufferSize min="4MB"/></Internal><Discovery>
<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain>
</CycloneDDS>"""


def write_drive(path: Path, points: int, seconds: int) -> Path:
    """Uncompressed, so that the figures are those of publishing."""
    rng = np.random.default_rng(1)
    cloud = np.zeros(points, POINT_DTYPE)
    for axis in "xyz":
        cloud[axis] = rng.normal(scale=30, size=points)
    with BagWriter(path, provenance={"kind": "clean"}, compression="none") as writer:
        for number in range(100 * seconds):
            stamp_ns = 10**18 + number * 10_000_000
            writer.write(SOURCE_FRAME, string(f"message {number}"), stamp_ns)
            if number % 10 == 0:
                writer.write(CLOCK, clock(stamp_ns), stamp_ns)
                writer.write_cdr(CLOUDS, cloud_to_cdr(cloud, stamp_ns, "ego/lidar"), stamp_ns)
    return path


def count_dds(qos: str) -> None:
    """A subscriber: prints how many clouds came, and its processor time."""
    from cyclonedds._clayer import ddspy_take
    from cyclonedds.core import ReadCondition, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    from advpipe.pipeline.live.dds_types import DdsType
    from advpipe.pipeline.live.publisher import PublishedTopic
    from advpipe.pipeline.messages.types import schema_text

    _domain, participant = Domain(DOMAIN, CONFIGURATION), DomainParticipant(DOMAIN)
    reliable = Policy.Reliability.Reliable(duration(seconds=1))
    policies = [reliable if qos == "reliable" else Policy.Reliability.BestEffort, Policy.History.KeepLast(5)]
    struct = DdsType(PublishedTopic(CLOUDS, schema_text(CLOUDS.type))).struct
    reader = DataReader(participant, Topic(participant, f"rt{CLOUDS.name}", struct), qos=Qos(*policies))
    waiting = WaitSet(participant)
    waiting.attach(ReadCondition(reader, 0xFFFF))
    print("ready", flush=True)
    count, last_s = 0, time.monotonic() + 20
    while time.monotonic() < last_s + 2:
        waiting.wait(duration(milliseconds=100))
        taken = ddspy_take(reader._ref, 0xFFFF, 10)  # as bytes: decoding in Python would take 60 ms a cloud
        if isinstance(taken, list):
            valid = sum(len(sample[0]) > 1000 for sample in taken)
            count, last_s = count + valid, time.monotonic() if valid else last_s
    print(json.dumps({"count": count, "cpu_s": time.process_time()}), flush=True)


def count_websocket(url: str) -> None:
    """A viewer: the same."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    count = 0
    with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        channels: list[dict[str, object]] = []
        while len(channels) < 3:
            channels += json.loads(socket.recv()).get("channels", [])
        (wanted,) = [one["id"] for one in channels if one["topic"] == CLOUDS.name]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": wanted}]}))
        print("ready", flush=True)
        try:
            while True:
                count += len(socket.recv()) > 1000
        except ConnectionClosed:
            pass
    print(json.dumps({"count": count, "cpu_s": time.process_time()}), flush=True)


def start(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def wait_until_ready(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"


def report(kinds: dict[str, subprocess.Popen[str]], sent: int) -> dict[str, int]:
    counts = {}
    for name, process in kinds.items():
        said = json.loads(process.communicate()[0].splitlines()[-1])
        counts[name] = said["count"]
        print(f"  {name:<12} {said['count']} of {sent} clouds, {said['cpu_s']:.2f} s of processor time")
    return counts


def play_to(
    bag: Path, options: PlayOptions, kinds: dict[str, subprocess.Popen[str]], sent: int
) -> dict[str, int]:
    begin_s, begin_cpu_s = time.monotonic(), time.process_time()

    def ready(where: str) -> None:
        if options.foxglove:
            kinds["viewer"] = start("--websocket", where)
            wait_until_ready(kinds["viewer"])

    summary = play(bag, options, ready=ready)
    took_s, cpu_s = time.monotonic() - begin_s, time.process_time() - begin_cpu_s
    print(str(summary).partition(": ")[2])
    print(f"  publisher    {cpu_s / sent * 1e3:.1f} ms of processor time a cloud; {took_s:.1f} s in all")
    return report(kinds, sent)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=80_000)
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--dds", help=argparse.SUPPRESS)
    parser.add_argument("--websocket", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.dds:
        count_dds(options.dds)
        return
    if options.websocket:
        count_websocket(options.websocket)
        return
    print(machine())
    passed, sent = True, 10 * options.seconds
    with scratch() as folder:
        bag = write_drive(Path(folder) / "drive", options.points, options.seconds)
        for _ in range(options.rounds):
            kinds = {name: start("--dds", name) for name in ("reliable", "best effort")}
            for process in kinds.values():
                wait_until_ready(process)
            counts = play_to(
                bag, PlayOptions(ros2=True, domain=DOMAIN, interface="lo", delay_s=3), kinds, sent
            )
            passed &= counts["reliable"] == sent
            passed &= counts["best effort"] >= (1 - BEST_EFFORT_LOSS) * sent
            counts = play_to(bag, PlayOptions(foxglove=True, port=0), {}, sent)
            passed &= counts["viewer"] == sent
    finish(passed)


if __name__ == "__main__":
    main()
