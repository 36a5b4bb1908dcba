"""Stage 1: one scenario in, one recorded drive out (Algorithm 1 of the paper, driven by the traffic)."""

from __future__ import annotations

import hashlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.partial import FolderKind, staged_folder
from advpipe.pipeline.progress import track
from advpipe.pipeline.scenario import Scenario, dump_scenario
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.simulate.lidar import Lidar
from advpipe.stages.simulate.network import load_network
from advpipe.stages.simulate.recorder import Recorder, Snapshot
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.traffic import Traffic
from advpipe.stages.simulate.walkers import draw_walkers
from advpipe.stages.simulate.world.bodies import draw_variants
from advpipe.stages.simulate.world.world import World

DATA_SET = FolderKind("data set", ("scenario.yaml", "clean"), ("scenario.yaml", "clean/metadata.yaml"))


@dataclass(frozen=True)
class SimulationSummary:
    """What was recorded; `road_users` counts every one that came into the LiDAR's range."""

    bag: Path
    frames: int
    points: int
    road_users: int


def simulate(scenario: Scenario, out: Path, *, overwrite: bool = False) -> SimulationSummary:
    """Simulates a scenario and records it as the data set folder `out`: scenario.yaml and clean/.

    Raises AdvpipeError for a map that is none, a network without room, or an output that exists.
    """
    clock, seed = scenario.simulation, scenario.simulation.seed
    lidar_sensor = scenario.sensors.lidars["lidar"]
    carrier_name = lidar_sensor.vehicle
    points, seen = 0, set[str]()
    with staged_folder(out, overwrite, DATA_SET) as folder, tempfile.TemporaryDirectory() as scratch:
        (folder / "scenario.yaml").write_text(dump_scenario(scenario), encoding="utf-8")
        network = load_network(scenario.map, Path(scratch))
        variants = draw_variants(named_generator(seed, "bodies"))
        world = World(scenario, network, variants)
        lidar = Lidar(lidar_sensor)
        provenance = _provenance(scenario)
        with (
            Traffic(scenario, network, variants, Path(scratch)) as traffic,
            BagWriter(
                folder / "clean", provenance=provenance, compression=scenario.recording.compression
            ) as writer,
        ):
            routes_m = [traffic.route_m(name) for name in scenario.vehicles]
            walkers = draw_walkers(scenario, world.roads, variants, routes_m)
            recorder = Recorder(scenario, writer)
            recorder.start(clock.stamp_ns(0), lidar.base_SE3_lidar)
            for frame in track(range(clock.frames), f"simulating {scenario.name}"):
                traffic.step()
                vehicles = traffic.road_users()
                carriers = {name: vehicles.pop(name) for name in scenario.vehicles}
                carrier = carriers[carrier_name]
                others = [user for name, user in carriers.items() if name != carrier_name]
                moving = [
                    *others,
                    *vehicles.values(),
                    *(walker.at(frame * clock.step_s) for walker in walkers),
                ]
                moving = _within(moving, carrier, lidar_sensor.range)
                hits = world.cast(lidar.rays(carrier.map_SE3_base), moving)
                cloud = lidar.measure(hits, named_generator(seed, "lidar", carrier_name, frame))
                parked = _within(world.parked, carrier, lidar_sensor.range)
                everyone = [*moving, *parked]
                recorder.record(
                    Snapshot(clock.stamp_ns(frame), carriers, everyone, cloud, lidar.base_SE3_lidar)
                )
                points += len(cloud)
                seen.update(user.id for user in everyone)
    return SimulationSummary(out / "clean", clock.frames, points, len(seen))


def _provenance(scenario: Scenario) -> dict[str, str]:
    map_file = scenario.map.opendrive or scenario.map.sumo_net or ""
    digest = hashlib.sha256(Path(map_file).read_bytes()).hexdigest()
    return clean_provenance(scenario.name, dump_scenario(scenario), scenario.simulation.seed, digest)


def _within(users: list[RoadUser], carrier: RoadUser, range_m: float) -> list[RoadUser]:
    near = [np.linalg.norm(user.position_m - carrier.position_m) <= range_m for user in users]
    return [user for user, is_near in zip(users, near, strict=True) if is_near]
