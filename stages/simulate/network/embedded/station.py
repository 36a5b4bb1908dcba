"""One station: a vehicle with a radio that sends CAMs, and further messages by its services."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.v2x.clock import clock_error_ns
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.congestion_control import congestion_control
from advpipe.pipeline.v2x.facilities.generation import (
    CHECK_INTERVAL_NS,
    CamGenerator,
    GeneratedCam,
    GenerationRules,
    first_check_ns,
)
from advpipe.pipeline.v2x.facilities.own_state import Identity, accuracy_of_estimate, own_state
from advpipe.pipeline.v2x.facilities.pseudonyms import PseudonymChanger
from advpipe.pipeline.v2x.facilities.reference_point import reference_points
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.simulate.network.embedded.self_knowledge import (
    ReceiverErrors,
    accuracy_of_receiver,
    self_estimates,
)
from advpipe.stages.simulate.network.embedded.service import GeneratedMessage, MessageService
from advpipe.stages.simulate.traffic.road_users import RoadUser


class Station:
    """One vehicle's ITS station, from its first appearance on.

    id: of its radio, the truth. pseudonym: what it calls itself now. user: the vehicle at the newest step.
    state: the station's own state then.
    """

    def __init__(
        self, v2x: V2x, seed: int, step_s: float, station_id: int, user: RoadUser, now_ns: int
    ) -> None:
        self.id, self.pseudonym, self.user = station_id, station_id, user
        self.type = user.variant.body.station_type or StationType.UNKNOWN
        self.errors = ReceiverErrors(
            v2x.others, step_s, named_generator(seed, "v2x", "self-knowledge", user.id)
        )
        self.state: StationState | None = None
        self.clock_error_ns = clock_error_ns(v2x, seed, station_id)
        self.services: list[MessageService] = []
        self._changer: PseudonymChanger | None = None
        if v2x.pseudonyms is not None:
            rng = named_generator(seed, "v2x", "pseudonym changes", station_id)
            self._changer = PseudonymChanger(v2x.pseudonyms, rng)
        self._generator = CamGenerator(now_ns, GenerationRules.of(v2x.cam))
        self._dcc = congestion_control(v2x)
        self._next_check_ns = first_check_ns(now_ns, seed, station_id)

    @property
    def place(self) -> RadioPlace:
        """The true pose of its radio."""
        user, variant = self.user, self.user.variant
        size_m = variant.length_m, variant.width_m, variant.height_m
        return RadioPlace(self.id, user.id, user.map_SE3_base, size_m, user.velocity_mps)

    def update_channel_load(self, busy_ratio: float) -> None:
        """Update congestion control with the channel load that the station measured over the last tenth of a
        second."""
        if self._dcc is not None:
            self._dcc.update(busy_ratio)

    @property
    def dcc_interval_s(self) -> float:
        """The minimum time between two messages that congestion control allows now."""
        return 0.0 if self._dcc is None else self._dcc.interval_s

    def messages_before(self, end_ns: int) -> Iterator[GeneratedMessage]:
        """The messages that it hands to its radio before `end_ns`; none while it is silent."""
        if self._changer is not None and self._changer.is_silent:
            while self._next_check_ns < end_ns:
                self._next_check_ns += CHECK_INTERVAL_NS
            for service in self.services:
                for _ in service.messages_before(end_ns):
                    pass
            return
        for cam in self._cams_before(end_ns):
            yield GeneratedMessage(cam.time_ns, cam.payload, cam.cam)
        for service in self.services:
            for made in service.messages_before(end_ns):
                if self._dcc is not None:
                    self._dcc.sent(len(made.payload))
                yield made

    def update_services(self, now_ns: int, drivers: Mapping[str, RoadUser]) -> None:
        """Hand the station's newest state, and all vehicles on the road, to its services."""
        if self.state is not None:
            for service in self.services:
                service.update(now_ns, self.state, self.user, drivers)

    def wants_pseudonym(self) -> bool:
        """Whether it takes another pseudonym now; call it once for each of its states."""
        if self._changer is None or self.state is None:
            return False
        return self._changer.update(self.state, any(service.is_active for service in self.services))

    def rename(self, pseudonym: int) -> None:
        """Take another pseudonym, from the next message on."""
        assert self.state is not None
        self.pseudonym = pseudonym
        self.state = replace(self.state, station_id=pseudonym)
        self._generator.forget()
        for service in self.services:
            service.rename(pseudonym)

    def _cams_before(self, end_ns: int) -> Iterator[GeneratedCam]:
        """Check the generation rules at every due instant before `end_ns`, with the newest state."""
        assert self.state is not None
        while self._next_check_ns < end_ns:
            cam = self._generator.check(self._next_check_ns, self.state, self.dcc_interval_s)
            self._next_check_ns += CHECK_INTERVAL_NS
            if cam is not None:
                if self._dcc is not None:
                    self._dcc.sent(len(cam.payload))
                yield cam


def update_states(
    stations: Sequence[Station],
    estimates: Mapping[str, Estimate],
    now_ns: int,
    v2x: V2x,
    step_s: float,
    geodesy: Geodesy,
) -> None:
    """Update the states of all stations from on-board estimates or simulated errors."""
    if not stations:
        return
    users = [station.user for station in stations]
    self_states = self_estimates(users, [station.errors for station in stations], estimates, step_s)
    lengths_m = np.array([user.variant.length_m for user in users])
    receiver = accuracy_of_receiver(v2x.others)
    for station, place, speed_mps, acceleration_mps2, yaw_rate_radps in zip(
        stations,
        reference_points(geodesy, self_states.map_SE3_base, lengths_m),
        self_states.speed_mps.tolist(),
        self_states.acceleration_mps2.tolist(),
        self_states.yaw_rate_radps.tolist(),
        strict=True,
    ):
        estimate = estimates.get(station.user.id)
        station.state = own_state(
            Identity(
                station.pseudonym,
                station.type,
                station.user.variant.length_m,
                station.user.variant.width_m,
                station.user.variant.body.trailer,
            ),
            now_ns + station.clock_error_ns,
            place,
            receiver if estimate is None else accuracy_of_estimate(estimate),
            speed_mps=speed_mps,
            acceleration_mps2=acceleration_mps2,
            yaw_rate_radps=yaw_rate_radps,
            lights=station.user.lights,
        )
