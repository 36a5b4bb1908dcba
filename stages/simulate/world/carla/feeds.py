"""Measurements of CARLA's sensors, matched by the number of their frame."""

from __future__ import annotations

import queue
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.carla.poses import transform_of

FIRST_TICKS = 20
"""A real server may lose the first frames after a subscription; by then, each sensor has to have sent one."""


class Feed:
    """One sensor on a vehicle's actor, from `__init__` to `close`.

    name: in messages. attributes: of its blueprint, as CARLA names them; all others keep CARLA's defaults.
    """

    def __init__(
        self,
        world: Any,
        carrier: Any,
        name: str,
        blueprint: str,
        attributes: Mapping[str, object],
        actor_SE3_sensor: Float64,
    ) -> None:
        self.name = name
        library = world.get_blueprint_library()
        if not library.filter(blueprint):
            raise UsageError(f"the server has no {blueprint}, which {name} needs")
        definition = library.find(blueprint)
        for key, value in attributes.items():
            if not definition.has_attribute(key):
                raise UsageError(f"CARLA's {blueprint} has no attribute {key}, which {name} needs")
            definition.set_attribute(key, str(value))
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._actor = world.spawn_actor(definition, transform_of(actor_SE3_sensor), attach_to=carrier)
        self._actor.listen(self._queue.put)

    def has_sent(self, timeout_s: float) -> bool:
        """Whether anything has arrived; it is dropped."""
        try:
            self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return False
        return True

    def skip(self) -> None:
        """Drop what has arrived."""
        with suppress(queue.Empty):
            while True:
                self._queue.get_nowait()

    def take(self, frame: int, timeout_s: float) -> Any:
        """The measurement of a frame. Raises AdvpipeError if it is lost, or late."""
        until_s = time.monotonic() + timeout_s
        while True:
            try:
                data = self._queue.get(timeout=max(until_s - time.monotonic(), 0.0))
            except queue.Empty:
                raise AdvpipeError(
                    f"CARLA's sensor {self.name} sent nothing for frame {frame} within {timeout_s:g} s; "
                    "lower its resolution, or raise carla.timeout_s"
                ) from None
            if data.frame == frame:
                return data
            if data.frame > frame:
                raise AdvpipeError(f"CARLA's sensor {self.name} lost frame {frame}: {data.frame} came next")

    @property
    def actor(self) -> int:
        """The number of the sensor's actor, which somebody else removes."""
        return int(self._actor.id)

    def stop(self) -> None:
        """Stop listening; a sensor that still listens could abort the interpreter at its end."""
        with suppress(RuntimeError):
            self._actor.stop()
