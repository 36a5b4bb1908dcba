"""The V2X domain's clock: the master, which the traffic and the world follow (Algorithm 1 of the paper)."""

from __future__ import annotations

from advpipe.pipeline.scenario.simulation import Simulation
from advpipe.stages.simulate.traffic import Traffic


class Communication:
    """Advances the simulation; each of its steps steps the traffic."""

    def __init__(self, clock: Simulation, traffic: Traffic) -> None:
        self._clock = clock
        self._traffic = traffic

    def simulate_until(self, frame: int) -> int:
        """Goes on to the instant of a recorded frame; its stamp in nanoseconds since 1970."""
        self._traffic.step()
        return self._clock.stamp_ns(frame)
