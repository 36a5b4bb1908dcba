"""The receivers of messages in a recorded drive, and the geodesy of its map."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.bag.latched import ReceiversInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.replay.v2x_drive import read_stations


@dataclass(frozen=True)
class V2xRecording:
    """One bag's receivers.

    geodesy: of the map. expiry_s: of entries in Local Dynamic Maps. listeners: station ids of the vehicles
    whose receptions are recorded, by name; None where the bag does not record the id. has_pseudonyms: whether
    stations change their pseudonyms. silence_s: for how long at most they send nothing before a change.
    """

    geodesy: Geodesy
    expiry_s: float
    listeners: dict[str, int | None]
    has_pseudonyms: bool = False
    silence_s: float = 0.0


def read_recording(reader: BagReader, until_ns: int | None = None) -> V2xRecording:
    """Read the receivers of a bag; until_ns: without vehicles that appear later.

    Raises AdvpipeError for a bag without its map's geographic origin.
    """
    if SCENARIO_INFO.name not in reader.topics:
        raise UsageError(
            f"{reader.path} has no {SCENARIO_INFO.name}: the geographic origin of its map is unknown; record "
            'a text like {"map": {"origin": {"latitude_deg": 48.1, "longitude_deg": 11.5}}} there'
        )
    info: ReceiversInfo = read_scenario_info(reader, ReceiversInfo)
    origin = info.map.origin
    rules = info.v2x.pseudonyms
    ids = {name: number for number, name in read_stations(reader, until_ns).items()}
    instrumented = ids.keys() & info.vehicles.keys()
    return V2xRecording(
        Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m),
        info.v2x.ldm.expiry_s,
        {name: ids.get(name) for name in sorted({*instrumented, *receiving_vehicles(reader)})},
        rules is not None,
        0.0 if rules is None else rules.longest_silence_s,
    )
