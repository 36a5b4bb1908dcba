"""The drive's road users as actors of CARLA."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.carla.blueprints import Blueprints
from advpipe.stages.simulate.world.carla.poses import ActorBox, transform_of

SPAWN_HEIGHTS_M = (25.0, 50.0, 75.0, 100.0)
"""Above an actor's place: CARLA refuses to spawn one where another is, and the place itself may be taken
until the batch has moved everybody."""

BRAKING_MPS2 = 0.5
"""From this deceleration on, the brake lights are on."""

LAMPS: Mapping[ExteriorLights, int] = {
    ExteriorLights.LOW_BEAM: 2,
    ExteriorLights.HIGH_BEAM: 4,
    ExteriorLights.RIGHT_TURN_SIGNAL: 16,
    ExteriorLights.LEFT_TURN_SIGNAL: 32,
    ExteriorLights.REVERSE: 64,
    ExteriorLights.FOG: 128,
    ExteriorLights.PARKING: 1,
    ExteriorLights.DAYTIME_RUNNING: 1,
}
"""Bits of `carla.VehicleLightState`."""

BRAKE_LAMP = 8


class Mirror:
    """Keeps an actor without physics for each road user, and removes it with the road user.

    actors: their numbers by the road users' ids. step_s: between two updates.
    """

    def __init__(self, client: Any, blueprints: Blueprints, step_s: float) -> None:
        self._client, self._blueprints, self._step_s = client, blueprints, step_s
        self.actors: dict[str, int] = {}
        self._blueprint_of: dict[str, str] = {}
        self._lamps: dict[str, int] = {}
        self._speeds_mps: dict[str, float] = {}

    def box(self, user: str) -> ActorBox:
        """The box of a mirrored road user."""
        return self._blueprints.box(self._blueprint_of[user])

    def map_SE3_actor(self, user: RoadUser) -> Float64:
        """Where the actor of a mirrored road user belongs."""
        return self.box(user.id).map_SE3_actor(user.map_SE3_base)

    def update(self, users: Sequence[RoadUser]) -> None:
        """Spawn, move and remove actors; CARLA shows it after its next tick.

        Raises AdvpipeError for a road user that CARLA has no room for.
        """
        import carla

        present = {user.id for user in users}
        gone = sorted(self.actors.keys() - present)
        if gone:
            self._client.apply_batch_sync(
                [carla.command.DestroyActor(self.actors.pop(name)) for name in gone], False
            )
        for name in gone:
            self._lamps.pop(name, None)
            self._speeds_mps.pop(name, None)
        self._spawn([user for user in users if user.id not in self.actors])
        batch = []
        for user in users:
            if user.id in self.actors:
                actor = self.actors[user.id]
                batch.append(carla.command.ApplyTransform(actor, transform_of(self.map_SE3_actor(user))))
                batch += self._lamp_commands(user, actor)
        self._client.apply_batch_sync(batch, False)

    def remove_all(self) -> None:
        """Remove every actor."""
        self.update(())

    def _spawn(self, users: Sequence[RoadUser]) -> None:
        import carla

        waiting = [user for user in users if self._choose(user)]
        reason = ""
        for height_m in SPAWN_HEIGHTS_M:
            if not waiting:
                return
            batch = []
            for user in waiting:
                definition = self._blueprints.definition(self._blueprint_of[user.id], f"advpipe {user.id}")
                place = transform_of(self.map_SE3_actor(user))
                place.location.z += height_m
                freeze = carla.command.SetSimulatePhysics(carla.command.FutureActor, False)
                batch.append(carla.command.SpawnActor(definition, place).then(freeze))
            refused = []
            for user, answer in zip(waiting, self._client.apply_batch_sync(batch, False), strict=True):
                if answer.has_error():
                    refused.append(user)
                    reason = answer.error
                else:
                    self.actors[user.id] = answer.actor_id
            waiting = refused
        if waiting:
            raise AdvpipeError(f"CARLA cannot spawn {waiting[0].id} anywhere above its place: {reason}")

    def _choose(self, user: RoadUser) -> bool:
        blueprint = self._blueprints.choose(user.variant)
        if blueprint is not None:
            self._blueprint_of[user.id] = blueprint
        return blueprint is not None

    def _lamp_commands(self, user: RoadUser, actor: int) -> Iterator[Any]:
        """A command where the lamps of a vehicle change."""
        import carla

        if user.variant.body.label == "pedestrian":
            return
        speed_mps = float(np.linalg.norm(user.velocity_mps))
        slower_mps = self._speeds_mps.get(user.id, speed_mps) - speed_mps
        lamps = BRAKE_LAMP if slower_mps > BRAKING_MPS2 * self._step_s else 0
        for light, bit in LAMPS.items():
            lamps |= bit if user.lights & light else 0
        if lamps != self._lamps.get(user.id):
            state = carla.VehicleLightState(lamps)
            yield carla.command.SetVehicleLightState(actor, state)
        self._lamps[user.id], self._speeds_mps[user.id] = lamps, speed_mps
