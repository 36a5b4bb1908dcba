"""Measures the speed of a message attack on a drive, relative to decoding plus encoding alone.

Ours: what every station sent goes, step by step, through the attack and its labels, and then through the
radio to the instrumented vehicle's map; decoding, encoding and reception included. The drive's steps are in
memory. Peer, the codec's own rate: each of the messages that are sent after the attack once from bytes to a
`Cam` (`decode_cam`) and once back (`encode_cam`), in the same process and in turns with ours. Besides,
without a mark: the same with reading the bag and making all messages of the new one.
"""

from __future__ import annotations

import argparse
import gc
from pathlib import Path

from common import compare, finish, machine, scratch, steady_memory

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.gc_freeze import gc_frozen
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, attack_spec
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.simulate.run import simulate

REACH = 0.8


def record(folder: Path, vehicles: int, duration_s: float) -> BagReader:
    """A drive with almost no LiDAR in which all vehicles send."""
    settings = [
        "sensors.lidars.lidar.channels=1",
        "sensors.lidars.lidar.points_per_second=1000",
        f"traffic.vehicles={vehicles}",
        f"simulation.duration_s={duration_s}",
        "v2x.penetration=1",
    ]
    simulate(load_scenario("boulevard", settings), folder / "drive")
    return BagReader(folder / "drive" / "clean")


class Attacked:
    """A drive in memory, and an attack that has not begun: `prepare` makes it anew for each run."""

    def __init__(self, reader: BagReader, attack: AttackSpec) -> None:
        self._reader, self._attack = reader, attack
        self._drive = V2xDrive(reader)
        self._steps = list(self._drive.steps())
        self.payloads: list[bytes] = []
        self.prepare()

    def prepare(self) -> None:
        """Reads what `forge` has to know beforehand; not timed."""
        self._change = forge(self._reader, [self._attack], 1)
        self._air = self._change.channel()

    def send(self) -> None:
        """Every step through the attack, its labels, the radio and the map."""
        self.payloads = []
        for step in self._steps:
            sent = self._change.edited(step) if step.end_ns is not None else []
            self._drive.send(self._air, step, sent)
            self.payloads += [one.payload for one in sent]

    def bag_to_messages(self) -> None:
        """From a bag to all V2X messages of the new one."""
        for _ in forge(self._reader, [self._attack], 1).messages():
            pass

    def codec(self) -> None:
        """The same messages decoded, and encoded again."""
        for payload in self.payloads:
            encode_cam(decode_cam(payload))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--attack", default="cam-position-offset")
    parser.add_argument("--share", type=float, default=0.2, help="of the stations that attack")
    parser.add_argument("--vehicles", type=int, default=230)
    parser.add_argument("--duration", type=float, default=10.0, help="of the drive in seconds")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--bag", type=Path, help="a drive that is recorded already")
    given = parser.parse_args()
    steady_memory()
    print(machine())
    spec = attack_spec({"type": given.attack, "attackers": {"share": given.share}})
    with scratch() as folder:
        reader = BagReader(given.bag) if given.bag else record(Path(folder), given.vehicles, given.duration)
        attacked = Attacked(reader, spec)
        attacked.send()
        gc.collect()
        sent = len(attacked.payloads)
        print(f"{given.attack} by {given.share:.0%}: {sent} messages")
        with gc_frozen():  # as `attack` does; the drive in memory is no work of either side
            core = compare(
                "attack, radio, map", attacked.send, attacked.codec, given.rounds, attacked.prepare
            )
            print(core.line(sent, "messages/s", REACH))
            whole = compare("bag to messages", attacked.bag_to_messages, attacked.codec, 1)
            print(whole.line(sent, "messages/s", 0))
    finish(core.ratio >= REACH)


if __name__ == "__main__":
    main()
