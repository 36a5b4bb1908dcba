"""Stands in for Artery where advpipe says what is sent.

    standin.py [--play RECORDING] [--note SUMS] [--fault NAME=STEP] [--protocol N] -f omnetpp.ini

It plays back what a real Artery has told, step by step, and fails where advpipe does not say what it said
then (`attacked.sums` beside `attacked.xz`, which --note writes); or else every station within 200 m receives
every message 0.4 ms later.
"""

from __future__ import annotations

import argparse
import hashlib
import lzma
import math
import os
import re
import signal
import socket
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path

RANGE_M, ON_AIR_NS = 200.0, 400_000
OLD = "<!> Error: Network 'advpipe.GivenWorld' not found, check .ini and .ned files"


class StandIn:
    """One run. faults: what goes wrong, and in which step."""

    def __init__(self, port: int, faults: dict[str, int]) -> None:
        self._advpipe = socket.create_connection(("127.0.0.1", port))
        self._faults, self._steps = faults, 0
        self._places_m: dict[int, tuple[float, float, float]] = {}

    def say(self, *records: bytes) -> None:
        self._advpipe.sendall(b"".join(struct.pack("<I", len(one)) + one for one in records))

    def block(self) -> list[bytes]:
        """What advpipe tells of a step, up to its end."""
        records = [b""]
        while records[-1][:1] != b"U":
            records.append(self._read(struct.unpack("<I", self._read(4))[0]))
        self._steps += 1
        self._fail()
        return records[1:]

    def simulate(self, block: list[bytes]) -> Iterator[bytes]:
        """Records of everything that happens in a step."""
        for record in block:
            if record[:1] == b"P":
                _, station, *place_m = struct.unpack("<cIddd", record)
                self._places_m[station] = (place_m[0], place_m[1], place_m[2])
            elif record[:1] == b"Q":
                del self._places_m[struct.unpack("<cI", record)[1]]
            elif record[:1] == b"M" and self._faults.get("busy") != self._steps:  # else it waits for ever
                _, time_ns, sender, number, power_dbm = struct.unpack_from("<cqIqd", record)
                for station, antenna_m in sorted(self._places_m.items()):
                    away_m = math.dist(antenna_m, self._places_m[sender])
                    if station != sender and away_m < RANGE_M:
                        got_dbm = power_dbm - 20 * math.log10(max(away_m, 1.0)) - 48
                        yield struct.pack("<cqIqdd", b"R", time_ns + ON_AIR_NS, station, number, got_dbm, 20)
                yield struct.pack("<cqq", b"E", time_ns + ON_AIR_NS, number)
            elif record[:1] == b"U":
                (until_ns,) = struct.unpack("<q", record[1:])
                for station in sorted(self._places_m):
                    yield struct.pack("<cqId", b"L", until_ns, station, 0.125)
                drift_ns = 5_000_000 if self._faults.get("drift") == self._steps else 0
                yield struct.pack("<cq", b"T", until_ns + drift_ns)

    def _read(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            data += self._advpipe.recv(size - len(data)) or sys.exit("<!> Error: advpipe is gone")
        return data

    def _fail(self) -> None:
        if self._faults.get("crash") == self._steps:
            os.kill(os.getpid(), signal.SIGSEGV)
        if self._faults.get("error") == self._steps:
            sys.exit("<!> Error: Signal power is negative -- in module (Radio) GivenWorld.node[3]")
        if self._faults.get("hang") == self._steps:
            time.sleep(3600)
        if self._faults.get("garbage") == self._steps:
            self.say(b"Z\0\0\0\0")


def checksum(block: list[bytes]) -> str:
    """Of all that a block says, to a micrometre and a millionth of a decibel: the last digits of computed
    places differ between processors."""
    found = hashlib.sha256()
    for record in block:
        if record[:1] == b"P":
            _, station, *place_m = struct.unpack("<cIddd", record)
            record = f"P {station} {[round(metres, 6) + 0.0 for metres in place_m]}".encode()
        elif record[:1] == b"M":
            _, time_ns, sender, number, power_dbm = struct.unpack_from("<cqIqd", record)
            packet = record[struct.calcsize("<cqIqd") :]
            record = f"M {time_ns} {sender} {number} {round(power_dbm, 6) + 0.0} ".encode() + packet
        found.update(struct.pack("<I", len(record)) + record)
    return found.hexdigest()


def play(standin: StandIn, recording: Path, note: str | None) -> None:
    """Answer each block with what was recorded. note: where to write the blocks' checksums."""
    steps = recorded(recording)
    standin.say(*next(steps))
    sums = [] if note else recording.with_suffix(".sums").read_text(encoding="ascii").split()
    for number, step in enumerate(steps):
        found = checksum(standin.block())
        if note:
            sums.append(found)
            Path(note).write_text("\n".join([*sums, ""]), encoding="ascii")
        elif found != sums[number]:
            sys.exit(f"<!> Error: step {number + 1} is not the one that was recorded")
        standin.say(*step)


def recorded(path: Path) -> Iterator[list[bytes]]:
    """What a real Artery told, step by step; then silence."""
    data = lzma.decompress(path.read_bytes())
    place, step = 0, list[bytes]()
    while place < len(data):
        (length,) = struct.unpack_from("<I", data, place)
        step.append(data[place + 4 : place + 4 + length])
        place += 4 + length
        if step[-1][:1] == b"T":
            yield step
            step = []


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--play", type=Path)
    parser.add_argument("--note")
    parser.add_argument("--fault", action="append", default=[])
    parser.add_argument("--protocol", type=int, default=1)
    parser.add_argument("-f", dest="ini", required=True)
    arguments = parser.parse_args()
    faults = {name: int(step) for name, _, step in (each.partition("=") for each in arguments.fault)}
    if "start" in faults:
        sys.exit("error while loading shared libraries: libINET.so: cannot open shared object file")
    if "old" in faults:
        sys.exit(OLD)
    if "no-hello" in faults:
        time.sleep(3600)
    port = re.search(r"\*\.stations\.port = (\d+)", Path(arguments.ini).read_text(encoding="utf-8"))
    assert port is not None
    standin = StandIn(int(port.group(1)), faults)
    if arguments.play:
        play(standin, arguments.play, arguments.note)
    else:
        standin.say(
            struct.pack("<cHH", b"H", arguments.protocol, 11) + b"OMNeT++ 5.6", struct.pack("<cq", b"T", 0)
        )
    while True:
        standin.say(*standin.simulate(standin.block()))


main()
