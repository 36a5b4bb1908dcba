"""CARLA as the world of a drive: it shows the drive's road users, and its sensors measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np
import shapely

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.core.verbosity import detail, notice
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.camera.daylight import sun_direction
from advpipe.pipeline.sensors.world import Offer
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import Roads, lay_out_roads
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.carla.actors import CarlaActors, TrafficManagerDrivers
from advpipe.stages.simulate.world.carla.blueprints import Blueprints
from advpipe.stages.simulate.world.carla.client import carla_errors, connect
from advpipe.stages.simulate.world.carla.maps import load_map
from advpipe.stages.simulate.world.carla.mirror import Mirror
from advpipe.stages.simulate.world.carla.poses import ActorBox, vector_of
from advpipe.stages.simulate.world.carla.sensors import VehicleSensors, check_sensor
from advpipe.stages.simulate.world.carla.session import Session, check_step
from advpipe.stages.simulate.world.carla.signals import Signals
from advpipe.stages.simulate.world.carla.surroundings import CarlaSurroundings
from advpipe.stages.simulate.world.carla.weather import carla_weather

CLEANUP_TIMEOUT_S = 2.0
"""For each call after an error: the server may be gone."""

LOST_TIMEOUT_S = 0.1


class CarlaWorld:
    """See `World` and `SteppedWorld`. Connects when it is entered.

    Raises UsageError for settings that CARLA's sensors lack.
    """

    def __init__(self, scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant]) -> None:
        self._scenario, self._network, self._variants = scenario, network, variants
        self.offers: frozenset[Offer] = frozenset({"road users", "scans", "pictures", "radar hits"})
        self.footprints: Sequence[shapely.Polygon] = ()
        self.roads: Roads = lay_out_roads(network)
        check_step(scenario.simulation.step_s)
        for place, _, section in scenario.sensors.mounted():
            check_sensor(f"sensors.{place}", section)
        if scenario.v2x.radio.building_loss != "none":
            notice("CARLA's buildings are not known to the radio: v2x.radio.building_loss has no effect")
        detail("world carla: environment and traffic.parked_per_km have no effect; the scenery is CARLA's")
        self._open = ExitStack()
        self._sensors: dict[str, VehicleSensors] = {}
        self._actors: dict[str, int] = {}

    def __enter__(self) -> CarlaWorld:
        self._client = connect(self._scenario.carla)
        with ExitStack() as opened:
            try:
                with carla_errors(self._scenario.carla):
                    self._begin(opened)
            except BaseException:
                self._client.set_timeout(CLEANUP_TIMEOUT_S)
                raise
            self._open = opened.pop_all()
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self._client.set_timeout(CLEANUP_TIMEOUT_S)
        self._open.close()

    def _begin(self, opened: ExitStack) -> None:
        """Prepare the server; the stack undoes it in the opposite order."""
        scenario, step_s = self._scenario, self._scenario.simulation.step_s
        world = load_map(self._client, scenario, self._network)
        self._session = Session(self._client, world, step_s)
        opened.callback(self._attempt, self._session.end)
        self._session.begin()
        origin, start_ns = scenario.map.origin, scenario.simulation.stamp_ns(0)
        sun = sun_direction(start_ns, origin.latitude_deg, origin.longitude_deg)
        world.set_weather(carla_weather(scenario.environment.weather, sun))
        blueprints = Blueprints(world.get_blueprint_library(), scenario.carla.blueprints)
        blueprints.measure(self._client, self._session, self._variants.values())
        self._drivers = TrafficManagerDrivers(self._client, world, scenario, blueprints)
        opened.callback(self._attempt, self._drivers.end)
        self._drivers.begin(self._variants)
        self._signals = Signals(world)
        opened.callback(self._attempt, self._signals.release)
        self._mirror = Mirror(self._client, blueprints, step_s)
        opened.callback(self._attempt, self._remove_mirrored)
        opened.callback(self._attempt, self._drivers.release)
        opened.callback(self._attempt, self._remove_sensors)
        self._carla_actors = CarlaActors(world, self._variants, self._drivers.actors)
        self._session.tick()
        self._drivers.start()

    def route_m(self, name: str) -> Float64 | None:
        if name not in self._drivers.actors:
            return None
        place = self._drivers.actors[name].get_location()
        return np.array([[place.x, -place.y, place.z]])

    def advance(self, frame: int, users: Sequence[RoadUser], signals: Mapping[str, str]) -> list[RoadUser]:
        with carla_errors(self._scenario.carla):
            self._mirror.update(users)
            self._signals.show(signals)
            if frame == 0:
                self._attach_sensors(self._session.tick(), users)
            snapshot = self._snapshot = self._session.tick()
            step_s = self._scenario.simulation.step_s
            own = self._carla_actors.users(snapshot, self._mirror.actors.values(), step_s)
            self._actors = self._mirror.actors | {user.id: actor for actor, user in own.items()}
            poses = {user.id: user.map_SE3_base for user in (*users, *own.values())}
            for name in sorted(self._sensors.keys() - poses.keys()):
                self._leave(name, snapshot.frame)
            for name, sensors in self._sensors.items():
                sensors.take(snapshot.frame, frame, poses[name])
        return list(own.values())

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> CarlaSurroundings:
        return CarlaSurroundings(self, carrier, users)

    def boxed(self, user: RoadUser) -> RoadUser | None:
        """A road user in the size that it has in CARLA; None for one that CARLA does not show."""
        if user.id in self._mirror.actors:
            box: ActorBox = self._mirror.box(user.id)
            return replace(user, variant=box.sized(user.variant))
        return user if user.id in self._actors else None

    def actor(self, name: str) -> int:
        """The number of a road user's actor."""
        return self._actors[name]

    def mirrors(self, name: str) -> bool:
        """Whether a road user is moved from outside."""
        return name in self._mirror.actors

    def reported_mps(self, name: str) -> Float64:
        """The velocity (3,) that CARLA knows of a road user; 0 for one that is moved from outside."""
        state = self._snapshot.find(self._actors[name])
        return np.zeros(3) if state is None else vector_of(state.get_velocity())

    def sensors(self, vehicle: str) -> VehicleSensors:
        """The sensors of an instrumented vehicle."""
        return self._sensors[vehicle]

    def _attach_sensors(self, snapshot: Any, users: Sequence[RoadUser]) -> None:
        """Mount the sensors of all instrumented vehicles, and wait until each of them sends."""
        scenario, world = self._scenario, self._session.world
        mirrored = self._mirror.actors
        own = self._carla_actors.users(snapshot, mirrored.values(), scenario.simulation.step_s)
        actors = {**mirrored, **{user.id: actor for actor, user in own.items()}}
        for name in sorted(scenario.vehicles):
            if name not in actors:
                raise AdvpipeError(
                    f"{name} is not in CARLA in the first frame: it needs a trajectory that begins at 0 s, "
                    "and a body for which CARLA has a blueprint"
                )
            carrier = world.get_actor(actors[name])
            box = ActorBox.of(carrier.bounding_box)
            sensors = VehicleSensors(scenario, name, name in self._drivers.actors)
            self._sensors[name] = sensors
            sensors.mount(world, carrier, box)
        for sensors in self._sensors.values():
            sensors.await_first(self._session.tick, scenario.carla.timeout_s)

    def _leave(self, name: str, frame: int) -> None:
        """A vehicle whose trajectory has ended takes its sensors along."""
        if name in self._drivers.actors:
            raise AdvpipeError(f"the actor of {name} has disappeared from CARLA in frame {frame}")
        self._destroy(self._sensors.pop(name).stop())

    def _attempt(self, step: Callable[[], None]) -> None:
        """One step of the clean-up. If the server is gone, its actors are, too, and nothing waits for it."""
        try:
            step()
        except RuntimeError as error:
            detail(f"CARLA: {one_line(error)}")
            self._client.set_timeout(LOST_TIMEOUT_S)

    def _remove_sensors(self) -> None:
        self._destroy([actor for sensors in self._sensors.values() for actor in sensors.stop()])

    def _destroy(self, actors: Sequence[int]) -> None:
        import carla

        self._client.apply_batch_sync([carla.command.DestroyActor(actor) for actor in actors], False)

    def _remove_mirrored(self) -> None:
        """Also tick, so that Traffic Manager learns that it has been released, before it is shut down."""
        self._mirror.remove_all()
        self._session.world.tick()
