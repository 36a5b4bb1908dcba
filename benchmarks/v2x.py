"""Measures the time of V2X in a drive of 200 equipped vehicles and one LiDAR, and messages per second.

The same drive with and without V2X in turns, in one process, and within the drive with V2X the time of
everything that V2X does in it, and of the codec in that: CAMs to bytes and back, and messages to CDR. The
latter two meet the same machine; where others use it, the drives in turns do not. Before that, the way of a
message without any drive: generate, encode, transmit, decode, Local Dynamic Map.

    python benchmarks/v2x.py [--vehicles 230] [--frames 60] [--rounds 3] [--set key=value]
    python benchmarks/v2x.py --set v2x.security=etsi
    python benchmarks/v2x.py --fleet 2000
    python benchmarks/v2x.py --alone 300 [--stations 300]

With signed messages, it also says which share of the drive signing and verifying take. The third form is of
fleets of 100 to 2000 stations without a drive, the fourth of a drive of messages alone, so many seconds: with
the traffic in a process of its own and without, whose bytes have to be the same.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from common import machine, scratch

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import v2x as bag_v2x
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.pipeline.v2x import channel as channel_module
from advpipe.pipeline.v2x.channel import Channel, Sent
from advpipe.pipeline.v2x.codec import message_codec
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities import generation
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam, encode_cam
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.stations import Stations
from advpipe.pipeline.v2x.section import V2x
from advpipe.pipeline.v2x.security.signer import EnvelopeSigner
from advpipe.pipeline.v2x.security.verifier import MessageVerifier
from advpipe.stages.simulate import recorder, run
from advpipe.stages.simulate.network.embedded.network import EmbeddedNetwork
from advpipe.stages.simulate.recorder import Recorder
from advpipe.stages.simulate.traffic import registry as traffic_registry
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic

REACH = 1.3
ALONE_SHARE = 0.4
"""300 stations for 300 s within two minutes."""
START_NS = 1_767_268_800_000_000_000
STEP_NS = 100_000_000

CODEC = (
    (generation, "encode_cam"),
    (message_codec.MessageCodec, "decode"),
    (channel_module, "core_of_tree"),
    (bag_v2x, "message_cdr"),
    (bag_v2x, "udp_packet_cdr"),
    (recorder, "sent_message"),
    (recorder, "stations_message"),
    (recorder, "ldm_snapshot_cdr"),
    (recorder, "ldm_detections_cdr"),
)
"""Functions where they are called: bytes and values, nothing else."""


SECURITY = ((EnvelopeSigner, "sign"), (MessageVerifier, "verify"))
"""Signatures, and the envelopes and certificates around them."""

V2X = (
    (EmbeddedNetwork, "simulate_until"),
    (EmbeddedNetwork, "update"),
    (EmbeddedNetwork, "local_dynamic_maps"),
    (Recorder, "_record_network_step"),
    (Recorder, "_record_radios"),
    (Recorder, "_record_maps"),
)
"""What a drive does for V2X, besides writing its messages; SUMO's step is inside of the first."""


class Clock:
    """Seconds of V2X in a drive, of the codec, and of the drive's loop."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("codec", "security", "v2x", "sumo", "loop"), 0.0)
        for owner, name in CODEC:
            self.wrap(owner, name, "codec")
        for owner, name in SECURITY:
            self.wrap(owner, name, "security")
        for owner, name in V2X:
            self.wrap(owner, name, "v2x")
        self.wrap(SumoTraffic, "step", "sumo")
        self.wrap(BagWriter, "write_cdr", "v2x", _is_v2x)
        run.track = self.track  # type: ignore[assignment]

    def wrap(self, owner: Any, name: str, part: str, counts: Callable[..., bool] = lambda *_: True) -> None:
        original: Callable[..., Any] = getattr(owner, name)

        def timed(*args: Any, **kwargs: Any) -> Any:
            if not counts(*args):
                return original(*args, **kwargs)
            start_s = time.perf_counter()
            try:
                return original(*args, **kwargs)
            finally:
                self.seconds[part] += time.perf_counter() - start_s

        setattr(owner, name, timed)

    def track(self, items: Any, _: str) -> Any:
        start_s = time.perf_counter()
        yield from items
        self.seconds["loop"] = time.perf_counter() - start_s

    def drive(self, scenario: Scenario) -> Taken:
        """Seconds in all, in V2X, in the codec, in signing and verifying; and CAMs sent."""
        self.seconds = dict.fromkeys(self.seconds, 0.0)
        with scratch() as folder:
            summary = run.simulate(scenario, Path(folder) / "drive")
        seconds, cams = self.seconds, 0 if summary.v2x is None else summary.v2x.cams
        return Taken(
            seconds["loop"], seconds["v2x"] - seconds["sumo"], seconds["codec"], seconds["security"], cams
        )


def _is_v2x(_: BagWriter, topic: Topic, *rest: object) -> bool:
    return "v2x/" in topic.name or "/ldm" in topic.name


class Taken(NamedTuple):
    total_s: float
    v2x_s: float
    codec_s: float
    security_s: float
    cams: int


def drives(settings: list[str], frames: int, rounds: int) -> float:
    """Prints what both drives take; the median ratio, within the drive with V2X."""
    clock = Clock()
    scenario = load_scenario("boulevard", settings)
    settings = [*settings, f"simulation.duration_s={frames * scenario.simulation.step_s}"]
    without, with_v2x = (load_scenario("boulevard", [*settings, f"v2x.enabled={on}"]) for on in (False, True))
    clock.drive(with_v2x)  # what is made once, such as message types
    plain, full = [], []
    for number in range(rounds):
        order = (without, with_v2x) if number % 2 else (with_v2x, without)
        taken = {scenario.v2x.enabled: clock.drive(scenario) for scenario in order}
        plain.append(taken[False])
        full.append(taken[True])
    print(f"drive of {frames} frames, {full[0].cams / frames:.0f} CAMs a frame")
    for name, seconds in (
        ("without V2X", [one.total_s for one in plain]),
        ("with V2X", [one.total_s for one in full]),
        ("V2X in it", [one.v2x_s for one in full]),
        ("its codec", [one.codec_s for one in full]),
        *([("its signatures", [one.security_s for one in full])] if full[0].security_s else []),
    ):
        print(f"  {name:14} {1000 * statistics.median(seconds) / frames:7.1f} ms a frame")
    if full[0].security_s:
        share = statistics.median(one.security_s / one.total_s for one in full)
        print(f"share of signing and verifying in the drive {100 * share:.1f} %")
    turns = [(one.total_s - one.codec_s) / other.total_s for one, other in zip(full, plain, strict=True)]
    print(f"in turns, beyond the codec {statistics.median(turns):.2f}")
    return statistics.median((one.total_s - one.codec_s) / (one.total_s - one.v2x_s) for one in full)


def states(stations: int, step: int) -> list[StationState]:
    """Cars on rings, at 4 to 20 m/s."""
    found = []
    for station in range(stations):
        speed_mps, radius_m = 4 + 16 * station / stations, 40 + 2 * station
        angle_rad = station + speed_mps / radius_m * step / 10
        found.append(
            StationState(
                station_id=station + 1,
                station_type=StationType.PASSENGER_CAR,
                time_ns=START_NS + step * STEP_NS,
                latitude_deg=48 + radius_m * math.sin(angle_rad) / 111_200,
                longitude_deg=11 + radius_m * math.cos(angle_rad) / 74_500,
                altitude_m=520.0,
                heading_rad=-angle_rad % math.tau,
                speed_mps=speed_mps,
                length_m=4.5,
                width_m=1.8,
                longitudinal_acceleration_mps2=0.0,
                yaw_rate_radps=speed_mps / radius_m,
                curvature_per_m=1 / radius_m,
                east_north_covariance_m2=(0.25, 0.0, 0.25),
                heading_std_rad=0.01,
                speed_std_mps=0.1,
            )
        )
    return found


def fleets(most: int) -> None:
    """What generating, encoding and transmitting the CAMs of growing fleets takes, and the memory."""
    print("stations  messages/s sent  CPU ms a step of 100 ms  memory MB")
    for stations in [count for count in (100, 300, 1000, 2000) if count <= most]:
        steps = max(10, 6000 // stations)
        drive, generators = (states(stations, step) for step in range(steps)), {}
        geodesy, sent = Geodesy(48.0, 11.0, 520.0), 0
        channel = Channel(V2x(), 1, geodesy, {})
        spent_s = 0.0
        for step, each in enumerate(drive):
            antennas_m = [geodesy.to_map([s.latitude_deg, s.longitude_deg, 521.5]) for s in each]
            places = Stations(np.arange(1, stations + 1), np.array(antennas_m))
            begin_ns, now = START_NS + step * STEP_NS, []
            start_s = time.process_time()
            for state in each:
                check_ns = begin_ns + 49_000 * state.station_id
                generator = generators.setdefault(state.station_id, generation.CamGenerator(START_NS))
                if (cam := generator.check(check_ns, state)) is not None:
                    key = int(message_keys(state.station_id, check_ns)[()])
                    number = sent + len(now)
                    now.append(Sent(number, key, state.station_id, check_ns, cam.payload, 23.0))
            channel.advance(begin_ns + STEP_NS, places, now)
            spent_s += time.process_time() - start_s
            sent += len(now)
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rate = sent / (steps * STEP_NS / 1e9)
        print(f"{stations:8} {rate:16,.0f} {1000 * spent_s / steps:24.1f} {memory_mb:10.0f}")


def alone(seconds: float, stations: int) -> bool:
    """Prints what a drive of messages alone takes in two processes and in one; whether it is soon."""
    settings = ["vehicles={}", f"traffic.vehicles={stations * 16 // 15}", "v2x.penetration=1"]  # not bicycles
    scenario = load_scenario("boulevard", [*settings, f"simulation.duration_s={seconds}"])
    bags, walls_s = set(), []
    print("processes  stations  CAMs     wall s  CPU s here  elsewhere  memory here MB")
    for processes in (2, 1):
        traffic_registry.pays_ahead = lambda _, is_ahead=processes == 2: is_ahead
        wall_s, here_s, elsewhere_s = time.perf_counter(), time.process_time(), _elsewhere_s()
        with scratch() as folder:
            drive = run.simulate(scenario, Path(folder) / "drive")
            walls_s.append(time.perf_counter() - wall_s)
            here_s, elsewhere_s = time.process_time() - here_s, _elsewhere_s() - elsewhere_s
            for bag in drive.bag.glob("*.mcap"):
                bags.add(hashlib.sha256(bag.read_bytes()).hexdigest())
        assert drive.v2x is not None
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        counts = f"{processes:9} {drive.v2x.stations:9} {drive.v2x.cams:5}"
        print(f"{counts} {walls_s[-1]:10.1f} {here_s:11.1f} {elsewhere_s:10.1f} {memory_mb:15.0f}")
    print("the same bytes" if len(bags) == 1 else "OTHER BYTES")
    is_soon = walls_s[0] <= ALONE_SHARE * seconds
    print(f"at most {ALONE_SHARE:g} of the drive's time: {'ok' if is_soon else 'NO'}")
    return len(bags) == 1 and is_soon


def _elsewhere_s() -> float:
    """The processor time of processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def messages(stations: int = 200, steps: int = 50) -> None:
    """Messages a second through everything but the drive, and through the codec alone."""
    drive = [states(stations, step) for step in range(steps)]
    geodesy = Geodesy(48.0, 11.0, 520.0)
    channel = Channel(V2x(), 1, geodesy, {1: "ego"})
    generators = [generation.CamGenerator(START_NS) for _ in range(stations)]
    antennas_m = [
        np.array([geodesy.to_map([s.latitude_deg, s.longitude_deg, 521.5]) for s in each]) for each in drive
    ]
    sent: list[Sent] = []
    received: list[bytes] = []
    start_s = time.perf_counter()
    for step, each in enumerate(drive):
        begin_ns, due = START_NS + step * STEP_NS, []
        for state, generator in zip(each, generators, strict=True):
            check_ns = begin_ns + 498_000 * state.station_id
            if (cam := generator.check(check_ns, state)) is not None:
                due.append((state.station_id, check_ns, cam.payload))
        ids, times_ns, payloads = zip(*due, strict=True) if due else ((), (), ())
        keys = message_keys(np.array(ids, np.int64), np.array(times_ns, np.int64)).tolist()
        numbers = range(len(sent), len(sent) + len(due))
        now = [
            Sent(number, key, station_id, time_ns, payload, 23.0)
            for number, key, station_id, time_ns, payload in zip(
                numbers, keys, ids, times_ns, payloads, strict=True
            )
        ]
        places = Stations(np.arange(1, stations + 1), antennas_m[step])
        received += [one.sent.payload for one in channel.advance(begin_ns + STEP_NS, places, now).received]
        channel.snapshot("ego", begin_ns + STEP_NS)
        sent += now
    whole_s = time.perf_counter() - start_s
    values = [decode_cam(message.payload) for message in sent]
    start_s = time.perf_counter()
    for cam in values:
        encode_cam(cam)
    for payload in received:
        decode_cam(payload)
    codec_s = time.perf_counter() - start_s
    print(f"{len(sent)} messages of {stations} stations, {len(received)} received by one")
    print(f"  generate, encode, transmit, decode, map {len(sent) / whole_s:9,.0f} messages/s")
    print(f"  codec alone                             {len(sent) / codec_s:9,.0f} messages/s")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=230)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--fleet", type=int, help="only fleets of up to this many stations, at most 2000")
    parser.add_argument("--alone", type=float, help="only a drive of messages alone, of so many seconds")
    parser.add_argument("--stations", type=int, default=300, help="of that drive")
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    print(machine())
    if given.fleet:
        fleets(given.fleet)
        return 0
    if given.alone:
        return int(not alone(given.alone, given.stations))
    messages()
    settings = [f"traffic.vehicles={given.vehicles}", "v2x.penetration=1", *given.set]
    ratio = drives(settings, given.frames, given.rounds)
    print(f"within, beyond the codec   {ratio:.2f} (reach: at most {REACH})")
    return int(ratio > REACH)


if __name__ == "__main__":
    sys.exit(main())
