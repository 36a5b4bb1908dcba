"""A network that a newcomer wrote from the docstrings of its protocol: everyone hears everything at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.scenario import Scenario
from advpipe.pipeline.v2x.channel import Received, Sent
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot, Verdict
from advpipe.stages.simulate.network.protocol import NetworkStep
from advpipe.stages.simulate.traffic.road_users import RoadUser


class Telepathy:
    """Every vehicle sends hello in the middle of each step; instrumented ones receive all others'
    messages."""

    def __init__(self, scenario: Scenario, step_traffic: Callable[[], None], footprints: object) -> None:
        self._listeners, self._step_ns = sorted(scenario.vehicles), round(scenario.simulation.step_s * 1e9)
        self._step_traffic = step_traffic
        self._ids: dict[str, int] = {}
        self._sent_count = self._now_ns = 0
        self.radios: Sequence[RadioPlace] = ()

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        time_ns = stamp_ns - self._step_ns // 2
        sent = tuple(
            Sent(number, number, radio.station_id, time_ns, b"hello", 23.0)
            for number, radio in enumerate(self.radios, start=self._sent_count)
        )
        self._sent_count += len(sent)
        received = tuple(
            Received(listener, one, None, time_ns, -50.0, 40.0, Verdict.CORRUPT)
            for one in sent
            for listener in self._listeners
            if self._ids.get(listener) != one.station_id
        )
        self._step_traffic()
        self._now_ns = stamp_ns
        return NetworkStep(stamp_ns, sent, received)

    def update(self, drivers: Mapping[str, RoadUser], estimates: object) -> None:
        for name in drivers:
            self._ids.setdefault(name, len(self._ids) + 1)
        places = [
            RadioPlace(self._ids[name], name, user.map_SE3_base, (4.0, 2.0, 1.5), user.velocity_mps)
            for name, user in drivers.items()
        ]
        self.radios = sorted(places, key=lambda place: place.station_id)

    def local_dynamic_maps(self) -> Sequence[tuple[str, LdmSnapshot]]:
        return ()

    def finish(self) -> NetworkStep:
        return NetworkStep(self._now_ns)

    def statistics(self) -> None:
        return None


class Deaf:
    """No network at all."""

    def __init__(self, *_: object) -> None: ...


class Broken(Telepathy):
    """Fails in its first step."""

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        raise KeyError("antenna")
