"""Whether topics have the rates that the scenario sets."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import NamedTuple

from pydantic import ValidationError

from advpipe.pipeline.messages.topics import CLOCK, TF, VehicleTopics
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import BagUnderTest

TOLERANCE = 0.005
"""Relative tolerance, since sums of rounded periods deviate a little."""

RECOVERED_KEY = "recovered"


class _Expected(NamedTuple):
    """A rate, and the resulting number of messages; None if unknown."""

    rate_hz: float
    messages: int | None


class Rates(MessageCheck):
    """Checks clean bags that advpipe recorded; `Copies` compares adversarial bags with them."""

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._first_ns: dict[str, int] = {}
        self._last_ns: dict[str, int] = {}
        self._counts: dict[str, int] = {}

    def see(self, view: MessageView) -> Iterator[Result]:
        name, time_ns = view.raw.topic.name, view.raw.log_time_ns
        self._first_ns.setdefault(name, time_ns)
        self._last_ns[name] = time_ns
        self._counts[name] = self._counts.get(name, 0) + 1
        return iter(())

    def check(self) -> Iterator[Result]:
        if not self.bag.is_own or self.bag.is_attack:
            return
        try:
            scenario = Scenario.model_validate(self.bag.scenario)
        except ValidationError:
            yield Unchecked(self.bag.place, "rates: its scenario does not fit this version of advpipe")
            return
        is_whole = RECOVERED_KEY not in self.bag.provenance
        for name, expected in expected_rates(scenario).items():
            where, count = f"{self.bag.place} {name}", self._counts.get(name, 0)
            if is_whole and expected.messages is not None and count != expected.messages:
                yield Fault(where, f"holds {count} messages; the scenario makes {expected.messages}")
            elif count > 1:
                rate_hz = (count - 1) * NS_PER_S / max(self._last_ns[name] - self._first_ns[name], 1)
                if abs(rate_hz - expected.rate_hz) > TOLERANCE * expected.rate_hz:
                    yield Fault(
                        where, f"has a rate of {rate_hz:.3f} Hz; the scenario sets {expected.rate_hz:g} Hz"
                    )


def expected_rates(scenario: Scenario) -> dict[str, _Expected]:
    """The rates that a scenario determines, by topic.

    A vehicle with a trajectory may come and go, so its topics have no expected rate.
    """
    clock, sensors = scenario.simulation, scenario.sensors
    step_hz = 1 / clock.step_s
    every_step = _Expected(step_hz, clock.frames)
    rates = {CLOCK.name: every_step, TF.name: every_step}
    for vehicle, options in scenario.vehicles.items():
        if options.driver == "trajectory":
            continue
        topics = VehicleTopics(vehicle)
        for topic in (topics.odometry, topics.true_odometry):
            rates[topic.name] = every_step
        for sensor, sections in sensors.carried_by(vehicle):
            for name, cadence in sensor.cadences(vehicle, sections, clock.step_s).items():
                messages = None if cadence.steps is None else ceil(clock.frames / cadence.steps)
                rates[name] = _Expected(cadence.rate_hz, messages)
    return rates
