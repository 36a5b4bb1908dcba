"""Mounted sensors in processes of their own: they look at one step while this process makes the next ones."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from types import TracebackType
from typing import NamedTuple, overload

from advpipe.pipeline.core.companion import Companion, may_have_companion
from advpipe.pipeline.core.local_processes import usable_cores
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.pipeline.sensors.sensor import Instant, Reading
from advpipe.stages.simulate.instrumented import Instrumented
from advpipe.stages.simulate.traffic.packed_users import PackedUsers, UserPacker, UserUnpacker
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.protocol import World

WORTH_A_PROCESS = 60
"""Frames of all vehicles together: a process takes a second of processor time to begin."""

STEPS_AHEAD = 2
"""By how many steps the rest of the drive is ahead of the sensors, at most; their clouds wait in memory."""


def pays_ahead(scenario: Scenario) -> bool:
    """Whether the sensors may have processes of their own, and are worth it.

    They observe only, unless stations tell others what they perceive (CPMs).
    """
    return (
        scenario.world == "raycast"
        and (not scenario.v2x.enabled or scenario.v2x.cpm is None)
        and usable_cores() > 1
        and may_have_companion()
        and len(scenario.vehicles) * scenario.simulation.frames >= WORTH_A_PROCESS
    )


def shared_out(scenario: Scenario) -> list[tuple[str, ...]]:
    """The keys of the mounted sensors of each process, in their order: those that take long are apart."""
    groups: list[tuple[bool, tuple[str, ...]]] = []
    keys = {key: sensor for name in scenario.vehicles for key, sensor in scenario.sensors.mounted_by(name)}
    for key in filter(keys.__contains__, SENSORS):
        takes_long = keys[key].takes_long
        if groups and groups[-1][0] == takes_long:
            groups[-1] = takes_long, (*groups[-1][1], key)
        else:
            groups.append((takes_long, (key,)))
    return [group for _, group in groups] or [()]


class _Drive(NamedTuple):
    scenario: Scenario
    world: World
    keys: tuple[str, ...]


class _Look(NamedTuple):
    vehicle: str
    frame: int
    stamp_ns: int
    motion: MotionStep
    users: PackedUsers


class SensorsAhead:
    """See `Elsewhere`: the readings are those of this process, byte for byte. An error is raised by whoever
    reads the readings.

    Enter it before the world is built, so that the other processes load their libraries meanwhile.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._packer, self._keys = UserPacker(), shared_out(scenario)
        self._processes: list[Companion[_Drive | _Look, tuple[Reading, ...]]] = []

    def __enter__(self) -> SensorsAhead:
        with ExitStack() as starting:
            for _ in self._keys:
                self._processes.append(Companion(_Observer))
                starting.callback(self._processes[-1].close)
            starting.pop_all()
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._processes:
            process.close()

    def begin(self, scenario: Scenario, world: World) -> None:
        """Let the other processes have the world."""
        for process, keys in zip(self._processes, self._keys, strict=True):
            process.ask(_Drive(scenario, world, keys))

    def readings(
        self, vehicle: str, frame: int, stamp_ns: int, motion: MotionStep, users: Sequence[RoadUser]
    ) -> Sequence[Reading]:
        look = _Look(vehicle, frame, stamp_ns, motion, self._packer.pack(users))
        return _Awaited([process.ask(look) for process in self._processes])


class _Awaited(Sequence[Reading]):
    """Readings that are waited for when they are read."""

    def __init__(self, answers: Sequence[Future[tuple[Reading, ...]]]) -> None:
        self._answers = answers

    @overload
    def __getitem__(self, index: int) -> Reading: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Reading]: ...
    def __getitem__(self, index: int | slice) -> Reading | Sequence[Reading]:
        return self._whole()[index]

    def __len__(self) -> int:
        return len(self._whole())

    def _whole(self) -> list[Reading]:
        return [reading for answer in self._answers for reading in answer.result()]


class _Observer:
    """What answers in another process."""

    def __init__(self) -> None:
        import advpipe.pipeline.sensors.lidar.rig  # noqa: F401
        from advpipe.stages.simulate.world.raycast.world import RaycastWorld  # loads Open3D

        self._casting = RaycastWorld
        self._vehicles: dict[str, Instrumented] = {}
        self._unpacker = UserUnpacker()

    def __call__(self, question: _Drive | _Look) -> tuple[Reading, ...]:
        if isinstance(question, _Drive):
            scenario, self._world, keys = question
            if isinstance(self._world, self._casting):
                self._world.prepare()
            self._vehicles = {name: Instrumented(scenario, name, keys=keys) for name in scenario.vehicles}
            return ()
        vehicle, frame, stamp_ns, motion, packed = question
        users = self._unpacker.unpack(packed)
        carrier = next(user for user in users if user.id == vehicle)
        return self._vehicles[vehicle].look(
            Instant(frame, stamp_ns, motion, self._world.around(carrier, users))
        )
