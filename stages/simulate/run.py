"""Stage 1: one scenario in, one recorded drive out (Algorithm 1 of the paper)."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.summary import BagSummary
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import as_usage_error
from advpipe.pipeline.core.gc_freeze import gc_frozen
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.core.progress import plan_progress, track, working_on
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.core.tabular import Rows
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.live.stream import live_stream
from advpipe.pipeline.scenario import Scenario, dump_scenario
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.pipeline.viewer_layouts.files import write_layouts
from advpipe.stages.simulate.bodies import Variant, draw_variants
from advpipe.stages.simulate.instrumented import Elsewhere, Instrumented
from advpipe.stages.simulate.network.registry import prepare_network
from advpipe.stages.simulate.network.session import NetworkSession
from advpipe.stages.simulate.perception import fleet_perception
from advpipe.stages.simulate.recorder import Recorder
from advpipe.stages.simulate.road_network.network import RoadNetwork, load_network
from advpipe.stages.simulate.sensors_ahead import STEPS_AHEAD, SensorsAhead, pays_ahead
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.walkers import draw_walkers
from advpipe.stages.simulate.world.actors import WorldActors
from advpipe.stages.simulate.world.protocol import SteppedWorld, World
from advpipe.stages.simulate.world.registry import build_world

DATA_SET = FolderKind("data set", ("scenario.yaml", "clean"), ("scenario.yaml", "clean/metadata.yaml"))

NETWORK, WORLD, RECORDING = "loading the road network", "building the world", "recording frames"
"""The phases of a simulation."""


@dataclass(frozen=True, repr=False)
class SimulationSummary(BagSummary):
    """The summary of a drive; `road_users` counts all that were ever within a sensor's range.

    bag: the clean bag. points: of all clouds together.
    v2x: None if the scenario disables V2X.
    """

    frames: int
    clouds: int
    points: int
    road_users: int
    v2x: Statistics | None

    def __str__(self) -> str:
        summary = (
            f"{self.bag}: {counted(self.frames, 'frame')}, "
            f"{counted(self.clouds, 'cloud')} of {self.points / max(self.clouds, 1):,.0f} points, "
            f"{counted(self.road_users, 'road user')} in range"
        )
        return "\n".join(
            [summary, *(f"{name}: {value}" for name, value in (self.v2x.lines() if self.v2x else ()))]
        )

    def to_dicts(self) -> Rows:
        """One row: the bag and its counts."""
        counts = ("frames", "clouds", "points", "road_users")
        of_v2x = {} if self.v2x is None else {"stations": self.v2x.stations, "cams": self.v2x.cams}
        return [{"bag": str(self.bag), **{name: getattr(self, name) for name in counts}, **of_v2x}]


@dataclass(frozen=True)
class _Setting:
    """The setting of a scenario: its road network, the world beside the roads, and all road users' bodies."""

    roads: RoadNetwork
    world: World
    variants: dict[str, Variant]


def simulate(
    scenario: Scenario, out: Path, *, overwrite: bool = False, live: str | None = None
) -> SimulationSummary:
    """Simulate a scenario and record it as the data set folder `out`: scenario.yaml and clean/.

    live: the publisher that also sends the drive to running programs, at most in real time.
    Raises AdvpipeError for an invalid map, a network without room, or an existing output.
    """
    plan_progress({NETWORK: 2, WORLD: 3, RECORDING: 90, "closing the bag": 3})
    text, seed = dump_scenario(scenario), scenario.simulation.seed
    plugins = plugin_names((scenario.traffic.source, scenario.world, scenario.v2x.network))
    with (
        staged_folder(out, overwrite, DATA_SET) as folder,
        scratch_folder() as scratch,
        plugin_errors(plugins),
        live_stream(live, scenario.recording.names) as stream,
        SensorsAhead(scenario) if live is None and pays_ahead(scenario) else nullcontext() as ahead,
    ):
        (folder / "scenario.yaml").write_text(text, encoding="utf-8")
        with as_usage_error():  # so far, only files that the scenario names have been read
            with working_on(NETWORK):
                roads = load_network(scenario.map, scratch, seed)
            with working_on(WORLD):
                variants = draw_variants(named_generator(seed, "bodies"), scenario.bodies)
                setting = _Setting(roads, build_world(scenario, roads, variants), variants)
                if ahead is not None:
                    ahead.begin(scenario, setting.world)
                session = prepare_network(scenario, roads, variants, scratch)
                prepared = open_traffic(session.scenario, session.roads, variants, scratch)
        provenance = clean_provenance(scenario.name, text, seed, roads.map_sha256)
        recording = scenario.recording
        with (
            gc_frozen(),
            setting.world if isinstance(setting.world, SteppedWorld) else nullcontext(),
            session,
            prepared as traffic,
            BagWriter(
                folder / "clean",
                provenance=provenance,
                compression=recording.compression,
                finish=write_layouts,
                split=BagSplit(recording.split_s, recording.split_mb),
            ) as writer,
        ):
            recorder = Recorder(scenario, writer, stream, STEPS_AHEAD if ahead else 0)
            v2x = _drive(scenario, setting, (session, traffic), recorder, ahead)
    frames, tally = scenario.simulation.frames, recorder.tally
    road_users = len(tally.road_users)
    return SimulationSummary(out / "clean", frames, tally.clouds, tally.points, road_users, v2x)


def _drive(
    scenario: Scenario,
    setting: _Setting,
    moving: tuple[NetworkSession, TrafficSource],
    recorder: Recorder,
    elsewhere: Elsewhere | None,
) -> Statistics | None:
    """The main loop of Algorithm 1: the network's clock advances and moves the traffic, the world follows,
    the sensors measure, and the stations get their new states."""
    clock, world, (session, traffic) = scenario.simulation, setting.world, moving
    vehicles = [Instrumented(scenario, name, elsewhere) for name in sorted(scenario.vehicles)]
    actors = WorldActors(world, traffic)
    routes_m = [actors.route_m(vehicle.name) for vehicle in vehicles]
    walkers = (
        draw_walkers(scenario, world.roads, setting.variants, routes_m, setting.roads.pavements_m)
        if vehicles
        else []  # nobody observes them
    )
    footprints = world.footprints if scenario.v2x.radio.building_loss == "obstacles" else None
    network = session.open(traffic, footprints)
    sight = fleet_perception(scenario.v2x, world, network, vehicles)
    recorder.start(clock.stamp_ns(0), vehicles, setting.roads.lanes_m, footprints)
    for frame in track(range(clock.frames), RECORDING):
        network_step = network.simulate_until(clock.stamp_ns(frame))  # and steps the traffic
        drivers = traffic.road_users()
        people = [walker.at(frame * clock.step_s) for walker in walkers]
        drivers, users = actors.advance(frame, drivers, people)
        snapshots = [
            vehicle.sense(network_step.stamp_ns, frame, drivers[vehicle.name], users, world)
            for vehicle in vehicles
            if vehicle.name in drivers  # a vehicle with a trajectory exists only while it lasts
        ]
        if sight is not None:
            sight.look(users, snapshots, frame * clock.step_s)
        network.update(drivers, {s.vehicle: s.onboard.estimate for s in snapshots})
        is_due = scenario.v2x.is_ldm_due(frame, clock.step_s)
        maps = network.local_dynamic_maps() if is_due else ()
        # A network of somebody else's may know no pseudonyms.
        recorder.record(network_step, snapshots, network.radios, maps, getattr(network, "pseudonyms", ()))
    network_step, v2x = network.finish(), network.statistics()
    recorder.finish(network_step, v2x)
    return v2x
