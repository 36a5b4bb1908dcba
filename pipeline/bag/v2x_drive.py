"""The V2X of a recorded drive, as it is to be sent again: all that radio and maps depend on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import shapely
from pydantic import ValidationError

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import SCENARIO_INFO, V2X_BUILDINGS, V2X_SENT, V2X_STATIONS
from advpipe.pipeline.bag.v2x import RadioPlace, sent_of_message, stations_of, stations_of_message
from advpipe.pipeline.errors import AdvpipeError, UsageError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.scenario.map import Origin
from advpipe.pipeline.scenario.v2x import V2x
from advpipe.pipeline.v2x.air import Air, Heard, Sent
from advpipe.pipeline.v2x.codec import CamTree
from advpipe.pipeline.v2x.radio.buildings import Buildings


class V2xStep(NamedTuple):
    """One step of the drive: radios stay where they are from its begin to its end.

    end_ns: None for the last one, in which nobody sends any more. sent: by the times they were handed over.
    """

    begin_ns: int
    end_ns: int | None
    radios: tuple[RadioPlace, ...]
    sent: tuple[Sent, ...]


class V2xDrive:
    """Reads it from a bag that `simulate` has recorded; memory holds one step.

    >>> drive = V2xDrive(BagReader(path))
    >>> air = drive.air()
    >>> for step in drive.steps():
    ...     heard = drive.send(air, step, step.sent)  # or other messages instead

    v2x, seed, origin: those of the scenario. stations: all vehicles that had a radio, by its number.
    listeners: the instrumented ones among them. Raises AdvpipeError for a bag without V2X.
    """

    def __init__(self, reader: BagReader) -> None:
        for topic in (SCENARIO_INFO, V2X_STATIONS):
            if topic.name not in reader.topics:
                raise UsageError(f"{reader.path} has no {topic.name}: no V2X to send again")
        self._reader = reader
        try:
            scenario = json.loads(self._text(SCENARIO_INFO.name))
            self.v2x = V2x.model_validate(scenario["v2x"])
            self.origin = Origin.model_validate(scenario["map"]["origin"])
            self.seed = int(scenario["simulation"]["seed"])
            names = set(scenario["vehicles"])
        except (ValidationError, LookupError, TypeError, ValueError):
            raise AdvpipeError(
                f"{reader.path}: {SCENARIO_INFO.name} holds no scenario of this version; record it again"
            ) from None
        self.stations: dict[int, str] = {
            station.station_id: station.vehicle
            for _, message in reader.messages(V2X_STATIONS.name)
            for station in message.stations
        }
        self.listeners = {number: name for number, name in self.stations.items() if name in names}

    def air(self, decoder: Callable[[bytes], CamTree] | None = None) -> Air:
        """The medium and the maps as they were when the drive began. decoder: see `Air`."""
        geodesy = Geodesy(self.origin.latitude_deg, self.origin.longitude_deg, self.origin.altitude_m)
        return Air(self.v2x, self.seed, geodesy, self.listeners, self._buildings(), decoder)

    def steps(self) -> Iterator[V2xStep]:
        """All steps of the drive, in order."""
        begin_ns: int | None = None
        radios: tuple[RadioPlace, ...] = ()
        sent: list[Sent] = []
        for raw in self._reader.raw_messages([V2X_STATIONS.name, V2X_SENT.name]):
            message = self._reader.decode(raw)
            if raw.topic.name == V2X_SENT.name:
                sent.append(sent_of_message(message))
                continue
            if begin_ns is not None:
                due = [one for one in sent if one.request_ns < raw.log_time_ns]
                yield V2xStep(begin_ns, raw.log_time_ns, radios, tuple(due))
                sent = sent[len(due) :]
            begin_ns, radios = raw.log_time_ns, stations_of_message(message)
        if begin_ns is not None:
            yield V2xStep(begin_ns, None, radios, ())

    def send(self, air: Air, step: V2xStep, sent: Sequence[Sent]) -> Heard:
        """Goes through one step with these messages."""
        stations = stations_of(self.v2x, step.radios)
        if step.end_ns is None:
            return air.finish(step.begin_ns, stations)
        return air.advance(step.end_ns, stations, sent)

    def _buildings(self) -> Buildings | None:
        if V2X_BUILDINGS.name not in self._reader.topics:
            return None
        return Buildings(footprints_of_text(self._text(V2X_BUILDINGS.name)))

    def _text(self, topic: str) -> str:
        return str(next(message for _, message in self._reader.messages(topic)).data)


def footprints_text(footprints: Sequence[shapely.Polygon]) -> str:
    """Footprints as a GeoJSON MultiPolygon in metres on the map; every coordinate to the bit."""
    return str(shapely.to_geojson(shapely.MultiPolygon(list(footprints))))


def footprints_of_text(text: str) -> list[shapely.Polygon]:
    """The footprints in such a text."""
    return list(shapely.from_geojson(text).geoms)
