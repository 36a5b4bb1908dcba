"""How wrong a vehicle's Local Dynamic Map is: false, missing and displaced entries, against the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from itertools import chain, groupby
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag.pseudonyms import radios_by_pseudonym
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_STATIONS, VehicleTopics
from advpipe.pipeline.messages.v2x import RadioPlace, stations_of_message
from advpipe.pipeline.results.v2x import LdmMetrics

DISPLACED_M = 3.0
"""An entry farther than this from its station's true position is displaced; extrapolating it for a second
stays within."""
MISSING_WITHIN_M = 150.0
"""Stations within this distance and without an entry are missing."""


class Known(NamedTuple):
    """A map entry, extrapolated with its speed to the snapshot's time; angles and sizes as claimed.

    station_id: as claimed, or that of the radio whose pseudonym it truly is. A station that has just changed
    its pseudonym has two entries for as long as entries are kept; both are its own, and neither is false.
    """

    station_id: int
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float


class Moment(NamedTuple):
    """One recorded map, and the truth at its time: all stations on the road, the map's owner apart."""

    time_ns: int
    own: RadioPlace
    entries: tuple[Known, ...]
    others: tuple[RadioPlace, ...]
    present: frozenset[int]
    """Ids of stations on the road now or at most one expiry time ago: their entries may still be there."""

    @property
    def false_nearby(self) -> int:
        """The number of false entries within `MISSING_WITHIN_M` of the map's owner."""
        x_m, y_m = self.own.map_SE3_base[:2, 3]
        return sum(
            math.hypot(entry.x_m - x_m, entry.y_m - y_m) <= MISSING_WITHIN_M
            for entry in self.entries
            if entry.station_id not in self.present or entry.station_id == self.own.station_id
        )


@dataclass(frozen=True)
class LdmError:
    """Errors of K recorded maps, (K,) each: counts, and the mean distance of entries from their stations.

    time_ns: of the map. known: entries. stations: those within `MISSING_WITHIN_M`. error_m: NaN without
    an entry of a true station.
    """

    time_ns: np.ndarray[Any, np.dtype[np.int64]]
    known: Float64
    stations: Float64
    false_entries: Float64
    missing: Float64
    displaced: Float64
    error_m: Float64

    def between(self, first_ns: int, last_ns: int) -> LdmError:
        """The maps from one time to another, both included."""
        chosen = (self.time_ns >= first_ns) & (self.time_ns <= last_ns)
        return LdmError(*(getattr(self, each.name)[chosen] for each in fields(self)))

    def metrics(self) -> LdmMetrics:
        """Means over the maps, the largest number of false entries at once, and the mean error."""
        return LdmMetrics(
            known=_mean(self.known),
            stations=_mean(self.stations),
            false_entries=_mean(self.false_entries),
            false_entries_max=float(self.false_entries.max(initial=0)),
            missing=_mean(self.missing),
            displaced=_mean(self.displaced),
            error_m=_mean(self.error_m),
        )


def moments(
    reader: BagReader, listener: str, expiry_s: float, window: Window = WHOLE_DRIVE
) -> Iterator[Moment]:
    """Every recorded map of a listener in a window while the listener was on the road, in order."""
    topic = VehicleTopics(listener).ldm.name
    last_seen_ns: dict[int, int] = {}
    truth = radios_by_pseudonym(reader)
    radios: tuple[RadioPlace, ...] = ()
    at_ns = -1
    in_time = reader.raw_messages([V2X_STATIONS.name, topic], last_ns=window.last_ns)
    # At one instant, either message may be recorded first.
    same = (sorted(each, key=_stations_first) for _, each in groupby(in_time, lambda raw: raw.log_time_ns))
    for raw in chain.from_iterable(same):
        message = reader.decode(raw)
        if raw.topic.name == V2X_STATIONS.name:
            # An attacker's roadside unit has no size: it is not a vehicle that a map should hold.
            radios = tuple(radio for radio in stations_of_message(message) if any(radio.size_m))
            at_ns = raw.log_time_ns
            last_seen_ns.update((radio.station_id, at_ns) for radio in radios)
            continue
        own = next((radio for radio in radios if radio.vehicle == listener), None)
        if own is None or at_ns != raw.log_time_ns or at_ns < window.begin_ns:
            continue
        keep_ns = round(expiry_s * 1e9)
        present = frozenset(s for s, seen_ns in last_seen_ns.items() if at_ns - seen_ns <= keep_ns)
        entries = tuple(_known(entry, at_ns, truth) for entry in message.objects)
        yield Moment(at_ns, own, entries, tuple(r for r in radios if r is not own), present)


def _stations_first(raw: RawMessage) -> bool:
    return raw.topic.name != V2X_STATIONS.name


def ldm_error(found: Iterator[Moment] | list[Moment]) -> LdmError:
    """Compare the maps with the truth.

    A false entry is of a station that does not exist, or of the map's owner. A displaced entry is more than
    `DISPLACED_M` from the true position of its station. A station within `MISSING_WITHIN_M` without any entry
    is missing.
    """
    rows, times_ns = [], []
    for moment in found:
        places = {radio.station_id: radio.map_SE3_base[:2, 3] for radio in moment.others}
        errors_m = [
            math.hypot(entry.x_m - places[entry.station_id][0], entry.y_m - places[entry.station_id][1])
            for entry in moment.entries
            if entry.station_id in places
        ]
        owner = moment.own.station_id
        false_entries = sum(
            e.station_id not in moment.present or e.station_id == owner for e in moment.entries
        )
        known = {entry.station_id for entry in moment.entries}
        at = moment.own.map_SE3_base[:2, 3]
        near = [s for s, place in places.items() if np.linalg.norm(place - at) <= MISSING_WITHIN_M]
        rows.append(
            (
                len(moment.entries),
                len(near),
                false_entries,
                sum(station not in known for station in near),
                # An entry without a position (NaN) counts as displaced.
                sum(not error <= DISPLACED_M for error in errors_m),
                float(np.nanmean(errors_m)) if np.isfinite(errors_m).any() else math.nan,
            )
        )
        times_ns.append(moment.time_ns)
    columns = np.array(rows, np.float64).reshape(-1, 6).T
    return LdmError(np.array(times_ns, np.int64), *columns)


def _known(entry: Any, at_ns: int, radios: Mapping[int, int]) -> Known:
    """radios: by the pseudonyms that honest stations truly used."""
    stamp = entry.generation_time
    age_s = (at_ns - int(stamp.sec) * build.NS_PER_S - int(stamp.nanosec)) / 1e9
    way_m = float(entry.speed) * age_s
    turn = (math.cos(entry.yaw), math.sin(entry.yaw)) if math.isfinite(entry.yaw + way_m) else (0.0, 0.0)
    carried_m = way_m if math.isfinite(way_m) else 0.0
    return Known(
        radios.get(int(entry.station_id), int(entry.station_id)),
        entry.centre.x + turn[0] * carried_m,
        entry.centre.y + turn[1] * carried_m,
        float(entry.yaw),
        float(entry.speed),
        float(entry.length),
        float(entry.width),
    )


def _mean(values: Float64) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan
