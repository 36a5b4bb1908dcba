"""Stands in for Artery: a second client of SUMO that plays back what a real run of Artery has told.

    standin.py [--play RECORDING] [--fault NAME=STEP] [--protocol N] -f omnetpp.ini

It reads the ports from omnetpp.ini as Artery does, keeps Artery's order of records and steps, and waits for
the same answers. Without a recording its stations are silent: it has none.
"""

from __future__ import annotations

import argparse
import lzma
import os
import re
import signal
import socket
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

STEP_NS = 100_000_000


class StandIn:
    """One run. faults: what goes wrong, and in which step."""

    def __init__(self, ini: str, faults: dict[str, int]) -> None:
        self._sumo_port = int(_value(ini, r"\*\.traci\.launcher\.port = (\d+)"))
        self._order = int(_value(ini, r"\*\.traci\.launcher\.clientId = (\d+)"))
        self._advpipe = socket.create_connection(
            ("127.0.0.1", int(_value(ini, r"\*\.traci\.nodes\.port = (\d+)")))
        )
        self._faults = faults
        self._steps = 0
        self._sumo: Any = None

    def play(self, records: Iterator[bytes]) -> None:
        """Send the records, and do what Artery does at them: answers after questions, steps after steps."""
        for record in records:
            if record[:1] == b"T":
                self._fail()
            self._advpipe.sendall(struct.pack("<I", len(record)) + record)
            if record[:1] == b"H":
                if "after-hello" in self._faults:
                    sys.exit("<!> Error: Cannot find the NED type -- in module (cModule) World (id=1)")
                self._connect()
            elif record[:1] in (b"A", b"B"):
                self._answer()
            elif record[:1] == b"T":
                self._sumo.simulationStep()
                self._steps += 1

    def _connect(self) -> None:
        import traci

        for _ in range(600):
            try:
                self._sumo = traci.connect(self._sumo_port, numRetries=0)
                break
            except (traci.exceptions.FatalTraCIError, OSError):
                time.sleep(0.05)
        self._sumo.setOrder(self._order)

    def _answer(self) -> bytes:
        (length,) = self._advpipe.recv(1) or sys.exit("<!> Error: advpipe has closed the connection")
        answer = b""
        while len(answer) < length:
            answer += self._advpipe.recv(length - len(answer))
        return answer

    def _fail(self) -> None:
        if self._faults.get("crash") == self._steps:
            os.kill(os.getpid(), signal.SIGSEGV)
        if self._faults.get("error") == self._steps:
            sys.exit("<!> Error: Signal power is negative -- in module (Radio) World.node[3].radio (id=7)")
        if self._faults.get("hang") == self._steps:
            time.sleep(3600)
        if self._faults.get("drift") == self._steps:
            self._advpipe.sendall(struct.pack("<Icq", 9, b"T", (self._steps + 2) * STEP_NS))
        if self._faults.get("garbage") == self._steps:
            self._advpipe.sendall(struct.pack("<I", 5) + b"Z\0\0\0\0")


def silent(protocol: int) -> Iterator[bytes]:
    """The records of a run without stations, without end."""
    yield struct.pack("<cHH", b"H", protocol, 11) + b"OMNeT++ 5.6"
    yield struct.pack("<cq", b"T", STEP_NS)
    for step in range(1, 1 << 30):
        yield struct.pack("<cq", b"B", step * STEP_NS)
        yield struct.pack("<cq", b"T", (step + 1) * STEP_NS)


def recorded(path: str) -> Iterator[bytes]:
    """The records of a recorded run, and then those of a run that goes on in silence."""
    data = lzma.decompress(Path(path).read_bytes())
    place, time_ns = 0, 0
    while place < len(data):
        (length,) = struct.unpack_from("<I", data, place)
        record = data[place + 4 : place + 4 + length]
        place += 4 + length
        if record[:1] == b"T":
            (time_ns,) = struct.unpack("<q", record[1:])
        yield record
    while True:
        yield struct.pack("<cq", b"B", time_ns)
        time_ns += STEP_NS
        yield struct.pack("<cq", b"T", time_ns)


def _value(ini: str, pattern: str) -> str:
    found = re.search(pattern, ini)
    assert found is not None, pattern
    return found.group(1)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--play")
    parser.add_argument("--fault", action="append", default=[])
    parser.add_argument("--protocol", type=int, default=1)
    parser.add_argument("-f", dest="ini", required=True)
    arguments = parser.parse_args()
    faults = {name: int(step) for name, _, step in (each.partition("=") for each in arguments.fault)}
    if "start" in faults:
        sys.exit("error while loading shared libraries: libINET.so: cannot open shared object file")
    if "no-hello" in faults:
        time.sleep(3600)
    ini = Path(arguments.ini).read_text(encoding="utf-8")
    standin = StandIn(ini, faults)
    standin.play(recorded(arguments.play) if arguments.play else silent(arguments.protocol))


main()
