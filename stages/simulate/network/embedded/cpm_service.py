"""The collective perception service of one station: what it perceives, and the CPMs that it sends of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64, yaw_of
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.cpm import PerceivedObject
from advpipe.pipeline.v2x.facilities.cpm_generation import OWN_SENSOR_ID, CpmGenerator
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.stages.simulate.network.embedded.service import GeneratedMessage
from advpipe.stages.simulate.network.embedded.station import Station
from advpipe.stages.simulate.network.protocol import Perceived
from advpipe.stages.simulate.traffic.road_users import RoadUser

FORGOTTEN_NS = 1_000_000_000
"""An object that has not been perceived for so long is a new one when it comes back."""
MOST_IDS = 1 << 16


@dataclass
class _Track:
    """An object that the station perceives. seen_ns: when it did last."""

    object_id: int
    first_ns: int
    seen_ns: int


@dataclass
class _Tracks:
    """The ids that the station gives to objects."""

    next_id: int
    known: dict[str, _Track] = field(default_factory=dict)

    def update(self, now_ns: int, names: tuple[str, ...]) -> list[_Track]:
        """The tracks of the objects that are perceived now."""
        self.known = {
            name: track for name, track in self.known.items() if now_ns - track.seen_ns <= FORGOTTEN_NS
        }
        for name in names:
            if name not in self.known:
                self.known[name] = _Track(self.next_id, now_ns, now_ns)
                self.next_id = (self.next_id + 1) % MOST_IDS
            self.known[name].seen_ns = now_ns
        return [self.known[name] for name in names]


class CpmService:
    """See `MessageService`. perceived: what a vehicle perceives now, in the map's frame.

    What is perceived is measured from the vehicle, with errors unless it has them already, and stated from
    where it believes to be: its own error of position and heading moves all objects of a message together.
    """

    def __init__(
        self,
        rules: CpmRules,
        seed: int,
        station: Station,
        active_ns: int,
        perceived: Callable[[RoadUser], Perceived],
    ) -> None:
        self._rules, self._station, self._perceived = rules, station, perceived
        self._generator = CpmGenerator(rules)
        self._rng = named_generator(seed, "v2x", "perception", station.user.id)
        self._ids = named_generator(seed, "v2x", "CPM check phase", station.user.id)
        self._next_check_ns = active_ns + int(self._ids.integers(CHECK_INTERVAL_NS))
        self._tracks = _Tracks(int(self._ids.integers(MOST_IDS)))
        self._state: StationState | None = None
        self._objects: list[PerceivedObject] = []

    def update(
        self, now_ns: int, state: StationState, user: RoadUser, drivers: Mapping[str, RoadUser]
    ) -> None:
        perceived = self._perceived(user)
        self._state = state
        tracks = self._tracks.update(now_ns, perceived.boxes.ids)
        self._objects = self._measured(now_ns, state, user, perceived, tracks)

    @property
    def is_active(self) -> bool:
        """Whether it has an event to report, for which the station keeps its pseudonym; CPMs have none."""
        return False

    def rename(self, pseudonym: int) -> None:
        """Take another station id, and other ids for all objects, which would tell the change otherwise."""
        self._tracks = _Tracks(int(self._ids.integers(MOST_IDS)))
        self._generator = CpmGenerator(self._rules)
        self._objects = []
        if self._state is not None:
            self._state = replace(self._state, station_id=pseudonym)

    def messages_before(self, end_ns: int) -> Iterator[GeneratedMessage]:
        assert self._state is not None
        while self._next_check_ns < end_ns:
            at_ns, self._next_check_ns = self._next_check_ns, self._next_check_ns + CHECK_INTERVAL_NS
            if at_ns < self._state.time_ns:  # before the station was switched on
                continue
            made = self._generator.check(at_ns, self._state, self._objects, self._station.dcc_interval_s)
            if made is not None:
                yield GeneratedMessage(at_ns, made.payload)

    def _measured(
        self, now_ns: int, state: StationState, user: RoadUser, perceived: Perceived, tracks: list[_Track]
    ) -> list[PerceivedObject]:
        rules, boxes = self._rules, perceived.boxes
        noise = self._rng.standard_normal((len(boxes), 5)) * perceived.is_exact
        pose = user.map_SE3_base
        front_m = pose[:3, 3] + pose[:3, 0] * user.variant.length_m / 2
        east_north = _east_north(state.heading_rad)
        offsets_m = (boxes.geometry[:, :3] - front_m) @ pose[:3, :3]
        places_m = offsets_m[:, :2] @ east_north.T + noise[:, :2] * rules.position_stddev_m
        moving_mps = np.nan_to_num(boxes.velocity_mps) @ pose[:3, :3]
        velocities_mps = moving_mps[:, :2] @ east_north.T + noise[:, 2:4] * rules.speed_stddev_mps
        heading_std_rad = math.radians(rules.heading_stddev_deg)
        yaws_rad = boxes.geometry[:, 6] - yaw_of(pose) + math.pi / 2 - state.heading_rad
        yaws_rad = np.mod(yaws_rad + noise[:, 4] * heading_std_rad, math.tau)
        return [
            PerceivedObject(
                object_id=track.object_id,
                measured_ms=0,
                east_m=place_m[0],
                north_m=place_m[1],
                up_m=up_m,
                east_mps=velocity_mps[0],
                north_mps=velocity_mps[1],
                label=CLASSES[label],
                yaw_rad=yaw_rad,
                length_m=size_m[0],
                width_m=size_m[1],
                height_m=size_m[2],
                position_std_m=rules.position_stddev_m,
                speed_std_mps=rules.speed_stddev_mps,
                yaw_std_rad=heading_std_rad,
                age_ms=min((now_ns - track.first_ns) // 1_000_000, 2047),
                sensor_ids=(OWN_SENSOR_ID,),
            )
            for track, place_m, up_m, velocity_mps, yaw_rad, size_m, label in zip(
                tracks,
                places_m.tolist(),
                offsets_m[:, 2].tolist(),
                velocities_mps.tolist(),
                yaws_rad.tolist(),
                boxes.geometry[:, 3:6].tolist(),
                boxes.labels.tolist(),
                strict=True,
            )
        ]


def _east_north(heading_rad: float) -> Float64:
    """Turns (forward, left) into (east, north)."""
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[sine, -cosine], [cosine, sine]])
