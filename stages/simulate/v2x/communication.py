"""The V2X domain and its clock: the master, which the traffic and the world follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.seeding import named_generator
from advpipe.pipeline.v2x.air import Air, Heard, Sent
from advpipe.pipeline.v2x.ldm import Snapshot
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.stations import Stations
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.traffic import Traffic
from advpipe.stages.simulate.v2x.station import Station, station_type


@dataclass(frozen=True)
class Exchange:
    """What happened on the air up to `stamp_ns` since the step before.

    stations: the radios that were on the road meanwhile, where they were at the step before, at
    `stations_ns`.
    """

    stamp_ns: int
    stations_ns: int
    stations: tuple[tuple[int, RoadUser], ...]
    sent: tuple[Sent, ...]
    heard: Heard


class Communication:
    """The stations' common clock. Each of its steps sends what is due, then steps the traffic.

    A message tells what its station knew at the step before: nobody knows yet how the traffic goes on.
    """

    def __init__(self, scenario: Scenario, traffic: Traffic, buildings: Buildings | None = None) -> None:
        self._clock, self._v2x = scenario.simulation, scenario.v2x
        self._traffic = traffic
        self._instrumented = tuple(sorted(scenario.vehicles))
        origin = scenario.map.origin
        self._geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._ids: dict[str, int] = {}
        self._equipped: dict[str, bool] = {}
        listeners = {self._id_of(name): name for name in self._instrumented}
        self.air = Air(self._v2x, self._clock.seed, self._geodesy, listeners, buildings)
        self._stations: dict[str, Station] = {}
        self._now_ns = self._clock.stamp_ns(0)
        self._messages = 0

    def simulate_until(self, frame: int) -> Exchange:
        """Goes on to the instant of a recorded frame: messages, then everybody on the road."""
        stamp_ns = self._clock.stamp_ns(frame)
        exchange = self._exchange(stamp_ns)
        self._traffic.step()
        self._now_ns = stamp_ns
        return exchange

    def update(self, drivers: Mapping[str, RoadUser], estimates: Mapping[str, Estimate]) -> None:
        """What the stations know at the step just made; instrumented vehicles have their estimates."""
        if not self._v2x.enabled:
            return
        equipped = [name for name, user in drivers.items() if self._is_equipped(name, user)]
        self._stations = {name: self._stations[name] for name in equipped if name in self._stations}
        for name in equipped:
            user = drivers[name]
            if name not in self._stations:
                self._stations[name] = Station(
                    self._v2x, self._clock.seed, self._clock.step_s, self._id_of(name), user, self._now_ns
                )
            self._stations[name].update(self._now_ns, user, estimates.get(name), self._geodesy)

    def local_dynamic_maps(self, frame: int) -> list[tuple[str, Snapshot]]:
        """The map of each instrumented vehicle on the road, where it is due to be recorded."""
        rate_hz = self._v2x.ldm.rate_hz
        every = 1 if rate_hz is None else round(1 / (rate_hz * self._clock.step_s))
        if not self._v2x.enabled or frame % every:
            return []
        names = [name for name in self._instrumented if name in self._stations]
        return [(name, self.air.snapshot(name, self._now_ns)) for name in names]

    def statistics(self) -> Statistics:
        """The drive's V2X in numbers."""
        return self.air.statistics()

    def _exchange(self, until_ns: int) -> Exchange:
        stations = sorted(self._stations.values(), key=lambda station: station.id)
        if until_ns == self._now_ns or not self._v2x.enabled:  # the first frame: nobody is known yet
            return Exchange(until_ns, until_ns, (), (), Heard((), ()))
        due = [(cam, station) for station in stations for cam in station.cams_before(until_ns)]
        due.sort(key=lambda item: (item[0].time_ns, item[1].id))
        ids = np.array([station.id for station in stations], np.int64)
        times_ns = np.array([cam.time_ns for cam, _ in due], np.int64)
        keys = message_keys(np.array([station.id for _, station in due], np.int64), times_ns)
        sent = tuple(
            Sent(number, int(key), station.id, cam.time_ns, cam.payload, self._v2x.radio.transmit_power_dbm)
            for number, (key, (cam, station)) in enumerate(zip(keys, due, strict=True), start=self._messages)
        )
        self._messages += len(sent)
        heard = self.air.advance(until_ns, Stations(ids, self._antennas_m(stations)), sent)
        for load in heard.loads:
            ratios = dict(zip(load.stations.tolist(), load.busy_ratio.tolist(), strict=True))
            for station in stations:
                station.hear_load(ratios[station.id])
        radios = tuple((station.id, station.user) for station in stations)
        return Exchange(until_ns, self._now_ns, radios, sent, heard)

    def _antennas_m(self, stations: list[Station]) -> Float64:
        places: Float64 = np.array([station.user.position_m for station in stations]).reshape(-1, 3)
        return places + (0.0, 0.0, self._v2x.radio.antenna_height_m)

    def _is_equipped(self, name: str, user: RoadUser) -> bool:
        """Instrumented vehicles always are; of the others that can be, the scenario's share."""
        if name not in self._equipped:
            chance = named_generator(self._clock.seed, "v2x", "equipped", name).random()
            can_be = station_type(user) is not None
            self._equipped[name] = name in self._instrumented or (can_be and chance < self._v2x.penetration)
        return self._equipped[name]

    def _id_of(self, name: str) -> int:
        """A 31-bit number drawn for the vehicle, as stations choose theirs; never one that is taken."""
        if name not in self._ids:
            rng, taken = named_generator(self._clock.seed, "v2x", "station id", name), set(self._ids.values())
            while (station_id := int(rng.integers(1, 2**31))) in taken:
                pass
            self._ids[name] = station_id
        return self._ids[name]
