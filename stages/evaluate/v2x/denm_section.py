"""Warnings (DENMs): which events vehicles learned of, which false ones, and which they were talked out of."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import RecordedReception, receiving_vehicles, recorded_receptions
from advpipe.pipeline.labels.messages import has_labels, read_labels
from advpipe.pipeline.messages.topics import SCENARIO_INFO, V2X_SENT
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.replay.v2x_drive import read_steps
from advpipe.pipeline.results.v2x_security import DenmRecord
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.facilities.denm import RELEVANCE_M, ActionId, Denm, decode_denm
from advpipe.pipeline.v2x.message_type import DENM, message_type_of
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Formula, ReportSection, Table
from advpipe.stages.evaluate.v2x.denm_checks import flagged
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.recording import V2xRecording, read_recording

HEADS = (
    *("bag", "vehicle", "true events", "known", "false events", "suppressed"),
    *("false DENMs", "flagged %", "honest DENMs", "flagged %"),
)
NOTE = (
    "True events: announced by stations within 500 m of the vehicle. Known: it received a DENM on it. "
    "Suppressed: a DENM of an attack ended it for the vehicle while its station still announced it. Flagged: "
    "by two simple checks, a baseline. An event is implausible where its station's last CAM is of another "
    "place (25 m), or of a driving vehicle that is to stand; its end, where a third station negates it, or "
    "its station goes on announcing it."
)
FORMULA = Formula(
    "false, suppressed events",
    "events of which a vehicle was warned though they do not exist, and true events that an attack ended for "
    "it; recall and false_positive_rate: shares of false and honest DENMs that two checks against the "
    "stations' CAMs flag",
    ("false_events", "suppressed"),
    title="False and suppressed warnings (DENMs)",
)


@dataclass(frozen=True)
class _Received:
    """The DENMs that one vehicle received."""

    receptions: list[RecordedReception]
    denms: list[Denm]


def denm_sections(clean: Path, adversarial: Sequence[Path]) -> tuple[ReportSection, ...]:
    """One section on the bags in which vehicles received DENMs; none if none did. The whole drives count."""
    bags = [(clean, "clean"), *((bag, bag_name(bag)) for bag in adversarial)]
    records = [record for bag, name in bags for record in _records(BagReader(bag), bag, name)]
    if not any(each.messages for each in records):
        return ()
    table = Table("Warnings that vehicles received", HEADS, tuple(map(_line, records)), NOTE)
    return (
        ReportSection(
            key="denm",
            title="Warnings (DENMs): false and suppressed events",
            lead=_lead(records),
            tables=(table,),
            records=tuple(records),
            formulas=(FORMULA,),
            terminal=(
                Table(
                    "Warnings (DENMs) that vehicles received",
                    HEADS[:8],
                    tuple(line[:8] for line in table.lines),
                ),
            ),
        ),
    )


def _lead(records: Sequence[DenmRecord]) -> str:
    false, suppressed = sum(each.false_events for each in records), sum(each.suppressed for each in records)
    known, events = sum(each.known for each in records), sum(each.events for each in records)
    return (
        f"Of {events:,} true events nearby, vehicles learned of {known:,}; attacks warned them of {false:,} "
        f"that do not exist, and ended {suppressed:,} for them."
    )


def _records(reader: BagReader, bag: Path, name: str) -> list[DenmRecord]:
    if not {SCENARIO_INFO.name, V2X_SENT.name} <= reader.topics.keys():
        return []
    of_vehicle = {one: _received(reader, one) for one in receiving_vehicles(reader)}
    if not any(each.denms for each in of_vehicle.values()):
        return []  # before more of the drive is read
    recording = read_recording(reader)
    received = {one: of_vehicle.get(one, _Received([], [])) for one in recording.listeners}
    false = {label.number for label in read_labels(bag)} if has_labels(bag) else set[int]()
    cams = _cams(reader, recording)
    near = _events_nearby(reader, list(received), false)
    return [_record((name, one), received[one], cams[one], near[one], false, recording) for one in received]


def _received(reader: BagReader, vehicle: str) -> _Received:
    kept = _Received([], [])
    for one in recorded_receptions(reader, vehicle, kind=DENM):
        try:
            denm = decode_denm(one.payload or b"")
        except MessageError:
            continue
        kept.receptions.append(one)
        kept.denms.append(denm)
    return kept


def _cams(reader: BagReader, recording: V2xRecording) -> dict[str, dict[int, list[Claim]]]:
    """What each vehicle has heard from each station, by arrival."""
    found: dict[str, dict[int, list[Claim]]] = {}
    for each in read_receptions(reader, recording=recording, is_linked=False):
        by_station = found.setdefault(each.listener, {})
        for claim in each.claims:
            by_station.setdefault(claim.station_id, []).append(claim)
    return found


def _events_nearby(
    reader: BagReader, vehicles: Sequence[str], false: set[int]
) -> dict[str, dict[ActionId, int]]:
    """The true events announced within `RELEVANCE_M` of each vehicle, and when last."""
    found: dict[str, dict[ActionId, int]] = {one: {} for one in vehicles}
    for step in read_steps(reader):
        places = {radio.vehicle: radio.map_SE3_base[:2, 3] for radio in step.radios}
        senders = {radio.station_id: radio.vehicle for radio in step.radios}
        for sent in step.sent:
            if message_type_of(sent.payload) is not DENM or sent.number in false:
                continue
            try:
                denm = decode_denm(sent.payload)
            except MessageError:
                continue
            sender = senders[sent.station_id]
            for vehicle in vehicles if denm.termination is None else ():
                if vehicle in places and vehicle != sender:
                    far_m = float(np.linalg.norm(places[vehicle] - places[sender]))
                    if far_m <= RELEVANCE_M:
                        found[vehicle][denm.action] = sent.request_ns
    return found


def _record(
    names: tuple[str, str],
    received: _Received,
    cams: Mapping[int, Sequence[Claim]],
    near: Mapping[ActionId, int],
    false: set[int],
    recording: V2xRecording,
) -> DenmRecord:
    is_false = np.array([one.number in false for one in received.receptions], bool)
    arrivals_ns = [one.arrival_ns for one in received.receptions]
    places_m = [_place_m(denm, recording) for denm in received.denms]
    found = np.array(flagged(list(zip(arrivals_ns, received.denms, places_m, strict=True)), cams), bool)
    pairs = list(zip(arrivals_ns, received.denms, is_false.tolist(), strict=True))
    true_events = {denm.action for _, denm, lies in pairs if not lies}
    false_events = {denm.action for _, denm, lies in pairs if lies and denm.termination is None}
    suppressed = {
        denm.action
        for at_ns, denm, lies in pairs
        if lies and denm.termination is not None and at_ns < near.get(denm.action, 0)
    }
    return DenmRecord(
        *names,
        messages=len(pairs),
        false_messages=int(is_false.sum()),
        events=len(near),
        known=len(true_events & near.keys()),
        false_events=len(false_events),
        suppressed=len(suppressed),
        recall=float(found[is_false].mean()) if is_false.any() else math.nan,
        false_positive_rate=float(found[~is_false].mean()) if (~is_false).any() else math.nan,
    )


def _place_m(denm: Denm, recording: V2xRecording) -> tuple[float, float]:
    if denm.latitude_deg is None or denm.longitude_deg is None:
        return math.nan, math.nan
    x_m, y_m, _ = recording.geodesy.to_map([denm.latitude_deg, denm.longitude_deg, 0.0])
    return float(x_m), float(y_m)


def _line(record: DenmRecord) -> tuple[str, ...]:
    honest = record.messages - record.false_messages
    return (
        *(record.bag, record.vehicle),
        *(formatted_number(one, 0) for one in (record.events, record.known)),
        *(formatted_number(one, 0) for one in (record.false_events, record.suppressed)),
        formatted_number(record.false_messages, 0),
        formatted_number(100 * record.recall, 1),
        formatted_number(honest, 0),
        formatted_number(100 * record.false_positive_rate, 1),
    )
