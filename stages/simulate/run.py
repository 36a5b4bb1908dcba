"""Stage 1: one scenario in, one recorded drive out (Algorithm 1 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import wrong_use
from advpipe.pipeline.core.garbage import settled
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.plugins import mistakes_told, own_words
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario import Scenario, dump_scenario
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.instrumented import Instrumented, Snapshot
from advpipe.stages.simulate.network.embedded.communication import Communication
from advpipe.stages.simulate.recorder import Recorder
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.walkers import draw_walkers
from advpipe.stages.simulate.world.raycast.world import World

DATA_SET = FolderKind("data set", ("scenario.yaml", "clean"), ("scenario.yaml", "clean/metadata.yaml"))


@dataclass(frozen=True)
class SimulationSummary:
    """What was recorded; `road_users` counts every one that came into a LiDAR's range.

    v2x: None where the scenario switches V2X off.
    """

    bag: Path
    frames: int
    clouds: int
    points: int
    road_users: int
    v2x: Statistics | None


def simulate(scenario: Scenario, out: Path, *, overwrite: bool = False) -> SimulationSummary:
    """Simulates a scenario and records it as the data set folder `out`: scenario.yaml and clean/.

    The V2X clock goes ahead and steps the traffic; the world follows, and the sensors look at it.

    Raises AdvpipeError for a map that is none, a network without room, or an output that exists.
    """
    clock, text = scenario.simulation, dump_scenario(scenario)
    clouds, points, seen = 0, 0, set[str]()
    with (
        staged_folder(out, overwrite, DATA_SET) as folder,
        scratch_folder() as scratch,
        mistakes_told(own_words([scenario.traffic.source])),
    ):
        (folder / "scenario.yaml").write_text(text, encoding="utf-8")
        with wrong_use():  # nothing but what the scenario names has been read so far
            network = load_network(scenario.map, scratch, clock.seed)
            variants = draw_variants(named_generator(clock.seed, "bodies"), scenario.bodies)
            world = World(scenario, network, variants)
            prepared = open_traffic(scenario, network, variants, scratch)
        vehicles = [Instrumented(scenario, name) for name in sorted(scenario.vehicles)]
        provenance = clean_provenance(scenario.name, text, clock.seed, network.map_sha256)
        with (
            settled(),
            prepared as traffic,
            BagWriter(
                folder / "clean", provenance=provenance, compression=scenario.recording.compression
            ) as writer,
        ):
            routes_m = [traffic.route_m(vehicle.name) for vehicle in vehicles]
            walkers = draw_walkers(scenario, world.roads, variants, routes_m, network.pavements_m)
            footprints = world.footprints if scenario.v2x.radio.building_loss == "obstacles" else None
            communication = Communication(scenario, traffic, footprints)
            recorder = Recorder(scenario, writer)
            recorder.start(clock.stamp_ns(0), vehicles, network.lanes_m, footprints)
            for frame in track(range(clock.frames), f"simulating {scenario.name}"):
                exchange = communication.simulate_until(frame)
                drivers = traffic.road_users()
                people = [walker.at(frame * clock.step_s) for walker in walkers]
                users = [*drivers.values(), *people]
                snapshots: list[Snapshot] = []
                for vehicle in vehicles:
                    if vehicle.name in drivers:  # one that follows a trajectory comes and goes with it
                        carrier = drivers[vehicle.name]
                        snapshots.append(vehicle.sense(exchange.stamp_ns, frame, carrier, users, world))
                communication.update(drivers, {s.vehicle: s.onboard.estimate for s in snapshots})
                maps = communication.local_dynamic_maps(frame)
                recorder.record(exchange, snapshots, communication.radios, maps)
                for view in (snapshot.view for snapshot in snapshots):
                    if view is not None:
                        clouds += len(view.clouds)
                        points += sum(map(len, view.clouds.values()))
                        seen.update(view.boxes.ids)
            exchange, v2x = communication.finish(), communication.statistics()
            recorder.finish(exchange, v2x)
    return SimulationSummary(out / "clean", clock.frames, clouds, points, len(seen), v2x)
