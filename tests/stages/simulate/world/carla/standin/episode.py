"""The state of the stand-in: settings, map, actors and time. Each public method is a remote call."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from actor import Actor
from geometry import matrix_of, pose_of
from library import Library
from measuring import Instruments
from protocol import RefusedError, Streams, accepted, actor_state, refused, sensor_header, snapshot_head

from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

WORLD_STREAM, WORLD_TYPE = 1, 17
NO_STEP = [False]
DEFAULT_STEP_S = 0.05
DEFAULTS = [False, False, NO_STEP, True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
"""Synchronous, unrendered, step, substeps (on, longest, most), culling, ragdolls, tiles, range, spectator."""


class Episode:
    """faults: `version`, after how many ticks it is `silent_after` or to `die_after`; the ticks
    whose measurements it `loses`. See also `Instruments`."""

    def __init__(
        self,
        library: Library,
        maps: Mapping[str, str],
        world: RaycastWorld,
        scenario: Scenario,
        spawn_points: list[Any],
        faults: Mapping[str, Any],
    ) -> None:
        self._spawn_points, self._scenario = spawn_points, scenario
        self._library, self._maps, self._world, self._faults = library, dict(maps), world, faults
        self._opendrive = ""
        self._settings = list(DEFAULTS)
        self._weather = [0.0] * 14
        self._managers: dict[int, str] = {}
        self._history: list[Any] = []
        self._episode, self._frame, self._elapsed_s, self._ticks = 1, 100, 0.0, 0
        self._numbers = 0
        self.streams = Streams("127.0.0.1")
        self._begin(faults.get("map", next(iter(maps))))

    @property
    def is_synchronous(self) -> bool:
        return bool(self._settings[0])

    def advance(self) -> None:
        """One tick: everything moves, then the client is told, then the sensors measure."""
        step_s = self._settings[2][1] if self._settings[2][0] else DEFAULT_STEP_S
        self._frame, self._elapsed_s = self._frame + 1, self._elapsed_s + step_s
        actors = list(self._actors.values())
        for actor in actors:
            actor.move(step_s)
        for actor in actors:
            if actor.parent is not None:
                actor.follow(pose_of(matrix_of(actor.parent.pose) @ actor.mount))
        states = [
            actor_state(
                one.id, one.pose.tolist(), one.velocity, one.turn_rate, one.acceleration, one.own_state()
            )
            for one in actors
        ]
        header = sensor_header(WORLD_TYPE, self._frame, self._elapsed_s, [0.0] * 6)
        head = snapshot_head(self._episode, step_s, self._is_new_map)
        self.streams.send(WORLD_STREAM, header + head + b"".join(states))
        self._is_new_map = False
        if self._ticks in self._faults.get("loses", ()):
            return
        bodies = [actor for actor in actors if actor.variant is not None]
        for actor in actors:
            if actor.sensor_type >= 0 and self.streams.has_listener(self._stream(actor)):
                header = sensor_header(actor.sensor_type, self._frame, self._elapsed_s, actor.pose.tolist())
                measured = self._instruments.measure(actor, bodies, step_s)
                self.streams.send(self._stream(actor), header + measured)

    # Time, settings and maps.

    def version(self) -> str:
        return str(self._faults.get("version", "0.9.16"))

    def get_episode_info(self) -> list[Any]:
        return [self._episode, [self.streams.token(WORLD_STREAM)]]

    def get_sensor_token(self, stream: int) -> list[bytes]:
        self.streams.announce(stream)
        return [self.streams.token(stream)]

    def get_episode_settings(self) -> list[Any]:
        return self._settings

    def set_episode_settings(self, settings: list[Any]) -> int:
        self._settings = settings
        self._history.append(["synchronous", settings[0]])
        return self._frame

    async def tick_cue(self) -> int:
        await self.streams.settle()
        self._ticks += 1
        if self._ticks > self._faults.get("die_after", np.inf):
            os._exit(3)
        if self._ticks > self._faults.get("silent_after", np.inf):
            await asyncio.sleep(3600)
        if self._ticks == self._faults.get("intruder_at"):  # another client that ticks, too
            self.advance()
        self.advance()
        return self._frame

    def get_available_maps(self) -> list[str]:
        return [f"/Game/Carla/Maps/{name}" for name in self._maps]

    def get_map_info(self) -> list[Any]:
        return [f"Carla/Maps/{self._map}", self._spawn_points]

    def get_map_data(self) -> str:
        return self._maps[self._map]

    def get_required_files(self, folder: str = "") -> list[str]:
        return []

    def load_new_episode(self, name: str, resets_settings: bool, layers: int) -> None:
        name = name.rsplit("/", 1)[-1] or self._map
        if name not in self._maps:
            raise RefusedError(f"Map '{name}' not found")
        if resets_settings:
            self._settings = list(DEFAULTS)
        self._episode += 1
        self._begin(name)

    def copy_opendrive_to_file(self, text: str, parameters: list[Any]) -> None:
        if "<OpenDRIVE" not in text:
            raise RefusedError("opendrive could not be correctly parsed")
        self._maps["OpenDriveMap"] = text

    def query_lights_state(self, client: Any) -> list[Any]:
        return []

    def get_weather_parameters(self) -> list[float]:
        return self._weather

    def set_weather_parameters(self, weather: list[float]) -> None:
        self._weather = weather

    # Actors.

    def get_actor_definitions(self) -> list[list[Any]]:
        return self._library.definitions()

    def get_spectator(self) -> list[Any]:
        return self._packed(self._spectator)

    def get_actors_by_id(self, numbers: list[int]) -> list[Any]:
        return [self._packed(self._actors[number]) for number in numbers if number in self._actors]

    def spawn_actor(self, description: list[Any], transform: list[Any]) -> list[Any]:
        return self._packed(self._spawn(description, transform))

    def spawn_actor_with_parent(
        self, description: list[Any], transform: list[Any], parent: int, attachment: int, socket: str = ""
    ) -> list[Any]:
        return self._packed(self._spawn(description, transform, parent))

    def destroy_actor(self, number: int) -> bool:
        self._actor(number)
        del self._actors[number]
        return True

    def set_actor_transform(self, number: int, transform: list[Any]) -> None:
        self._actor(number).pose = np.array([*transform[0], *transform[1]])

    def set_actor_simulate_physics(self, number: int, has_physics: bool) -> None:
        self._actor(number).has_physics = has_physics

    def apply_control_to_vehicle(self, number: int, control: list[Any]) -> None:
        self._actor(number).control = control

    def apply_control_to_walker(self, number: int, control: list[Any]) -> None:
        self._actor(number).walk = control

    def set_vehicle_light_state(self, number: int, lights: list[int]) -> None:
        actor = self._actor(number)
        actor.lights = lights[0]
        self._history.append(["lamps", actor.values.get("role_name", ""), lights[0]])

    def get_vehicle_light_states(self) -> list[list[int]]:
        return [[one.id, one.lights] for one in self._actors.values() if one.blueprint.startswith("vehicle.")]

    def set_traffic_light_state(self, number: int, state: int) -> None:
        self._history.append(["light", self._actor(number).values["sign_id"], state])
        self._actor(number).signal = state

    def freeze_all_traffic_lights(self, frozen: bool) -> None:
        self._history.append(["frozen", frozen])
        for actor in self._actors.values():
            actor.frozen = frozen

    def reset_all_traffic_lights(self) -> None:
        return None

    def get_actor_bounding_box(self, number: int) -> list[Any]:
        return self._packed(self._actor(number))[3]

    def get_physics_control(self, number: int) -> list[Any]:
        """17 fields; Traffic Manager asks for them, and uses the wheels' steering."""
        wheels = [
            [2.0, 0.25, 70.0 if front else 0.0, 35.0, 1500.0, 3000.0, 20.0, 2.0, 17.0, [x, y, 35.0]]
            for front, x in ((True, 100.0), (False, -100.0))
            for y in (-80.0, 80.0)
        ]
        torque, gears, steering = (
            [[0.0, 500.0], [5000.0, 500.0]],
            [[1.0, 0.5, 0.65]],
            [[0.0, 1.0], [120.0, 1.0]],
        )
        engine = [torque, 5000.0, 1.0, 0.15, 2.0, 0.35, True, 0.5, 10.0, 4.0, gears]
        return [*engine, 1500.0, 0.3, [0.0, 0.0, 0.0], steering, wheels, False]

    def apply_batch(self, commands: list[Any], ticks: bool) -> list[Any]:
        return [self._command(command[0]) for command in commands]

    # Traffic Manager's register.

    def is_traffic_manager_running(self, port: int) -> bool:
        return port in self._managers

    def get_traffic_manager_running(self, port: int) -> list[Any]:
        return [self._managers.get(port, ""), port if port in self._managers else 0]

    def add_traffic_manager_running(self, where: list[Any]) -> bool:
        is_new = where[1] not in self._managers
        self._managers[where[1]] = where[0]
        return is_new

    def destroy_traffic_manager(self, port: int) -> bool:
        return self._managers.pop(port, None) is not None

    # For tests; CARLA has no such calls.

    def test_faults(self, faults: dict[str, Any]) -> None:
        """Replace the faults, and count ticks anew."""
        self._faults, self._ticks = faults, 0
        self._instruments.faults = faults

    def test_state(self) -> dict[str, Any]:
        """What a test wants to know."""
        return {
            "synchronous": self._settings[0],
            "map": self._map,
            "episode": self._episode,
            "weather": self._weather,
            "managers": list(self._managers),
            "actors": [[one.id, one.blueprint, one.pose.tolist()] for one in self._actors.values()],
            "lamps": {one.values.get("role_name", ""): one.lights for one in self._actors.values()},
            "signals": {
                one.values["sign_id"]: [one.signal, one.frozen]
                for one in self._actors.values()
                if "sign_id" in one.values
            },
            "history": self._history,
        }

    # Helpers; names with an underscore are no remote calls.

    def _begin(self, name: str) -> None:
        self._map, self._is_new_map = name, True
        self._actors: dict[int, Actor] = {}
        origin = [re.search(rf"\+{key}=([-+.\de]+)", self._maps[name]) for key in ("lat_0", "lon_0")]
        latitude, longitude = (float(found[1]) if found else 0.0 for found in origin)
        self._instruments = Instruments(self._world, self._scenario, (latitude, longitude), self._faults)
        self._spectator = self._add([0, "spectator", []], [0.0, 0.0, 30.0, 0.0, 0.0, 0.0])
        for number, signal in enumerate(
            re.findall(r'<signal id="([^"]+)"[^>]*dynamic="yes"', self._maps[name])
        ):
            sign = [["sign_id", 4, signal]]
            self._add([0, "traffic.traffic_light", sign], [number, 0.0, 5.0, 0.0, 0.0, 0.0])

    def _add(self, description: list[Any], pose: Any) -> Actor:
        self._numbers += 1
        actor = Actor(self._numbers, description, pose, self._library)
        self._actors[actor.id] = actor
        return actor

    def _actor(self, number: int) -> Actor:
        if number not in self._actors:
            raise RefusedError(f"unable to find actor with id {number}")
        return self._actors[number]

    @staticmethod
    def _stream(actor: Actor) -> int:
        return WORLD_STREAM + actor.id

    def _packed(self, actor: Actor) -> list[Any]:
        box = [[0.0, 0.0, actor.box_z_m], actor.extent, [0.0, 0.0, 0.0], actor.id]
        token = self.streams.token(self._stream(actor)) if actor.sensor_type >= 0 else b""
        parent = actor.parent.id if actor.parent is not None else 0
        return [actor.id, parent, actor.description, box, bytes([actor.tag] if actor.tag else []), token]

    def _spawn(self, description: list[Any], transform: list[Any], parent: int = 0) -> Actor:
        if description[1] not in self._library:
            raise RefusedError("Spawn failed because of invalid actor description")
        pose = np.array([*transform[0], *transform[1]], np.float64)
        fresh = Actor(0, description, pose, self._library)
        for other in self._actors.values():
            if fresh.variant is not None and other.variant is not None:
                apart = np.abs((np.linalg.inv(matrix_of(other.pose)) @ [*pose[:3], 1.0])[:3])
                if (apart < np.add(fresh.extent, other.extent)).all():
                    raise RefusedError("Spawn failed because of collision at spawn position")
        actor = self._add(description, pose)
        if parent:
            actor.parent, actor.mount = self._actor(parent), matrix_of(pose)
            self._history.append(["sensor", actor.blueprint, actor.values])
            actor.follow(pose_of(matrix_of(actor.parent.pose) @ actor.mount))
        return actor

    def _command(self, command: list[Any], number: int | None = None) -> list[Any]:
        """One command of a batch; number: of the actor that an earlier command has spawned."""
        kind, fields = command
        try:
            if kind == 0:
                description, transform, parent, _, _, following = fields
                spawned = self._spawn(description, transform, parent[1] if parent[0] else 0)
                for one in following:
                    self._command(one[0], spawned.id)
                return accepted(spawned.id)
            calls = {
                1: self.destroy_actor,
                2: self.apply_control_to_vehicle,
                4: self.apply_control_to_walker,
                6: self.set_actor_transform,
                14: self.set_actor_simulate_physics,
                18: lambda one, lights: self.set_vehicle_light_state(one, [lights]),
            }
            target = fields[0] if number is None else number
            calls[kind](target, *fields[1:])
            return accepted(target)
        except RefusedError as refusal:
            return refused(refusal)
