"""CARLA's own vehicles and pedestrians as road users of the drive, and those that Traffic Manager drives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.carla.blueprints import LABELS_OF_BASE_TYPE, Blueprints
from advpipe.stages.simulate.world.carla.poses import ActorBox, pose_of, vector_of

STANDING_MPS = 1e-3


@dataclass(frozen=True)
class _OwnActor:
    name: str
    box: ActorBox
    variant: Variant


class CarlaActors:
    """Every vehicle and pedestrian of the server that is not a mirrored road user."""

    def __init__(self, world: Any, variants: Mapping[str, Variant], driven: Collection[str]) -> None:
        self._world, self._variants = world, variants
        self._driven = driven
        self._known: dict[int, _OwnActor | None] = {}
        self._last_m: dict[int, Float64] = {}

    def users(self, snapshot: Any, mirrored: Collection[int], step_s: float) -> dict[int, RoadUser]:
        """Road users by the numbers of their actors, with their true sizes.

        One with a role name of an instrumented vehicle that CARLA drives goes by that name. A vehicle that
        its owner teleports reports no velocity; it gets that of its last move.
        """
        states = {state.id: state for state in snapshot}
        if new := states.keys() - self._known.keys() - set(mirrored):
            self._learn(sorted(new))
        users, places = {}, {}
        for actor, known in self._known.items():
            if known is None or actor not in states or actor in mirrored:
                continue
            state = states[actor]
            pose = pose_of(state.get_transform()) @ known.box.actor_SE3_base
            velocity_mps = vector_of(state.get_velocity())
            if np.linalg.norm(velocity_mps) < STANDING_MPS and actor in self._last_m:
                velocity_mps = (pose[:3, 3] - self._last_m[actor]) / step_s
            places[actor] = pose[:3, 3]
            users[actor] = RoadUser(known.name, known.variant, pose, velocity_mps)
        self._last_m = places
        return users

    def forget(self, actors: Collection[int]) -> None:
        """Never report these, such as sensors and samples."""
        self._known |= dict.fromkeys(actors)

    def _learn(self, actors: Sequence[int]) -> None:
        self.forget(actors)
        taken = {known.name for known in self._known.values() if known is not None}
        for actor in self._world.get_actors(list(actors)):
            if not actor.type_id.startswith(("vehicle.", "walker.")):
                continue
            role = str(actor.attributes.get("role_name", ""))
            name = role if role in self._driven and role not in taken else f"carla.{actor.id}"
            box = ActorBox.of(actor.bounding_box)
            self._known[actor.id] = _OwnActor(name, box, self._variant(actor, box))
            taken.add(name)

    def _variant(self, actor: Any, box: ActorBox) -> Variant:
        """The body of the same class that is nearest in size, in the actor's own size."""
        is_walker = actor.type_id.startswith("walker.")
        base = "pedestrian" if is_walker else str(actor.attributes.get("base_type", "car"))
        label = LABELS_OF_BASE_TYPE.get(base, "car")
        alike = [one for one in self._variants.values() if one.body.label == label]
        nearest = min(
            alike,
            key=lambda one: float(np.abs(box.sizes_m - (one.length_m, one.width_m, one.height_m)).sum()),
        )
        return box.sized(nearest)


class TrafficManagerDrivers:
    """The instrumented vehicles with `driver: carla` that have no driver in CARLA yet.

    actors: the `carla.Vehicle` of every instrumented vehicle that CARLA moves, by name.
    """

    def __init__(self, client: Any, world: Any, scenario: Scenario, blueprints: Blueprints) -> None:
        self._client, self._world, self._scenario = client, world, scenario
        self._blueprints = blueprints
        self._port = scenario.carla.traffic_manager_port
        self._manager: Any = None
        self._ours: list[Any] = []
        self.actors: dict[str, Any] = {}

    def begin(self, variants: Mapping[str, Variant]) -> None:
        """Find the user's actors by their role names, and let Traffic Manager drive a new one for the rest.

        Raises AdvpipeError where there is no room to spawn one, or the Traffic Manager's port is in use.
        """
        names = [name for name, one in self._scenario.vehicles.items() if one.driver == "carla"]
        vehicles = self._world.get_actors().filter("vehicle.*")
        found = {actor.attributes.get("role_name"): actor for actor in vehicles}
        for name in names:
            if name in found:
                self.actors[name] = found[name]
                continue
            actor = self._spawn(name, variants[f"{self._scenario.vehicles[name].body}.0"])
            self.actors[name] = actor
            self._ours.append(actor)

    def start(self) -> None:
        """Let the Traffic Manager drive its vehicles, once they have appeared."""
        if not self._ours:
            return
        try:
            self._manager = self._client.get_trafficmanager(self._port)
        except RuntimeError as error:
            raise AdvpipeError(
                f"CARLA's Traffic Manager cannot use port {self._port} ({one_line(error)}); set "
                "carla.traffic_manager_port to a free one"
            ) from None
        self._manager.set_synchronous_mode(True)
        self._manager.set_random_device_seed(self._scenario.simulation.seed % 2**31)
        for actor in self._ours:
            actor.set_autopilot(True, self._port)

    def release(self) -> None:
        """Take the vehicles back from Traffic Manager; a tick has to follow before `end`."""
        for actor in self._ours if self._manager is not None else ():
            actor.set_autopilot(False, self._port)

    def end(self) -> None:
        """Shut Traffic Manager down, and only then remove its vehicles: the other way round, it aborts."""
        import carla

        if self._manager is not None:
            self._manager.set_synchronous_mode(False)
            self._manager.shut_down()
        batch = [carla.command.DestroyActor(actor.id) for actor in self._ours]
        self._client.apply_batch_sync(batch, False)

    def _spawn(self, name: str, variant: Variant) -> Any:
        blueprint = self._blueprints.choose(variant)
        if blueprint is None:
            raise AdvpipeError(f"CARLA has no vehicle for vehicles.{name}.body {variant.body.name}")
        definition = self._blueprints.definition(blueprint, name)
        places = self._world.get_map().get_spawn_points()
        rng = named_generator(self._scenario.simulation.seed, "carla", name)
        for index in rng.permutation(len(places)):
            actor = self._world.try_spawn_actor(definition, places[int(index)])
            if actor is not None:
                return actor
        raise AdvpipeError(f"none of the {len(places)} spawn points of CARLA's map has room for {name}")
