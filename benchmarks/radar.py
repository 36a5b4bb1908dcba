"""The processor time of a radar's scan, for each preset, and its memory.

    python benchmarks/radar.py [--frames 20] [--scans 1000] [--scenario town06 or highway ...]

The scene is that of a drive: the instants of a simulation with LiDARs and radars are kept, and each radar
senses them again. Marks: 5 ms a scan, 30 ms of the 4D imaging radar; memory that does not grow. Prints the
time that passes and the processor time of all threads; the mark is of the first, on a machine of its own.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from pathlib import Path

from common import finish, machine, scratch

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.radar.presets import RADAR_PRESETS
from advpipe.pipeline.sensors.radar.radars import Radars
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant
from advpipe.pipeline.sensors.weather import Weather
from advpipe.stages.simulate import run

MARKS_MS = {"long-range": 5.0, "corner": 5.0, "imaging-4d": 30.0}
MOST_GROWTH_MB = 8.0
"""Of resident memory after the first tenth of the scans: freed blocks that the allocator keeps."""


def recorded_instants(scenario_name: str, frames: int) -> list[Instant]:
    """The instants of a drive's radars."""
    kept: list[Instant] = []

    class KeepingRadars(Radars):
        def sense(self, instant: Instant):
            kept.append(instant)
            return super().sense(instant)

    from advpipe.pipeline.sensors import registry as sensors

    sensors.SENSORS["radars"] = KeepingRadars  # type: ignore[index]
    try:
        settings = ["sensors.radars={front: {preset: long-range}}", f"simulation.duration_s={frames / 10}"]
        with scratch() as folder:
            run.simulate(load_scenario(scenario_name, settings), Path(folder) / "drive")
    finally:
        sensors.SENSORS["radars"] = Radars  # type: ignore[index]
    return kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--scans", type=int, default=1000)
    parser.add_argument("--scenario", default="boulevard")
    options = parser.parse_args()
    print(machine())
    instants = recorded_instants(options.scenario, options.frames)
    users = statistics.mean(len(one.world.road_users(250.0)) for one in instants)
    print(f"{options.scenario}: {len(instants)} instants, {users:.0f} road users within 250 m")
    passed = True
    for name in RADAR_PRESETS:
        passed &= time_preset(name, instants, options.scans)
    finish(passed)


def time_preset(name: str, instants: list[Instant], scans: int) -> bool:
    """Time the scans of one preset, print a line, and return whether it keeps its marks."""
    radars = Radars("ego", {name: RadarSensor(preset=name)}, DriveSettings(1, 0.1, Weather(), False))
    passed_ms, used_ms, sizes = [], [], []
    early_kb = 0
    for number in range(scans + 1):
        instant = instants[number % len(instants)]
        begin_s, begin_used_s = time.perf_counter(), time.process_time()
        reading = radars.sense(instant)
        passed_ms.append(1e3 * (time.perf_counter() - begin_s))
        used_ms.append(1e3 * (time.process_time() - begin_used_s))
        sizes.append(len(reading.messages[0][1]))
        if number == scans // 10:
            early_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    growth_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - early_kb) / 1024
    median_ms, mark_ms = statistics.median(passed_ms[1:]), MARKS_MS[name]
    good = median_ms < mark_ms and growth_mb < MOST_GROWTH_MB
    print(
        f"{name:12} {median_ms:6.2f} ms a scan (mark {mark_ms:g}), processor "
        f"{statistics.median(used_ms[1:]):6.2f} ms; {statistics.mean(sizes) / 20:5.0f} returns; memory "
        f"+{growth_mb:.1f} MB  {'ok' if good else 'BEYOND'}"
    )
    return good


if __name__ == "__main__":
    main()
