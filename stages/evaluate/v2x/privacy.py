"""Privacy: how well a tracker follows stations through the changes of their pseudonyms."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.bag.latched import ReceiversInfo, read_scenario_info
from advpipe.pipeline.bag.pseudonyms import read_pseudonyms
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.replay.v2x_drive import V2xStep, read_steps
from advpipe.pipeline.results.v2x_security import DensityRecord, PrivacyRecord
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.cam import CamCore
from advpipe.pipeline.v2x.facilities.cam_tree import core_of_tree
from advpipe.pipeline.v2x.facilities.ldm import reports_of_cams
from advpipe.pipeline.v2x.message_type import is_cam
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Formula, ReportSection, Table
from advpipe.stages.evaluate.v2x.tracker import PseudonymTrack, Sighting, linked

NEAR_M = 100.0
DENSITIES = (0, 1, 3, 6, 11)
"""Least numbers of other stations nearby in each line of the table."""
NOTE = (
    "The tracker hears every CAM of the drive. It extrapolates each pseudonym that falls silent by its last "
    "speed and heading, and takes the nearest one for the predecessor of each new pseudonym, within 5 m and "
    "what a station can stray meanwhile. Followed: to the right pseudonym. Other stations: within 100 m when "
    "the pseudonym changed."
)
FORMULA = Formula(
    "tracker's success",
    "share of the changes of pseudonyms after which a tracker that hears every CAM takes the new pseudonym "
    "for the right station's; tracked: the longest stretch of a station's time on the road that the tracker "
    "takes for one station's, as a share of it, the mean over stations",
    ("success", "tracked", "linked"),
    title="The tracker's success (privacy)",
)


class _Change(NamedTuple):
    """A station's new pseudonym, the one before, and how many other stations were near."""

    pseudonym: int
    before: int
    neighbours: int


@dataclass
class _Heard:
    """What the tracker hears, and the truth. used: pseudonyms by radio, in the order of their use."""

    tracks: dict[int, PseudonymTrack] = field(default_factory=dict)
    used: dict[int, list[int]] = field(default_factory=dict)
    neighbours: dict[int, int] = field(default_factory=dict)


def privacy_sections(clean: Path, adversarial: Sequence[Path] = ()) -> tuple[ReportSection, ...]:
    """One section on the clean drive; none where stations keep their identities. The whole drive counts."""
    del adversarial
    reader = BagReader(clean)
    if not read_pseudonyms(reader):
        return ()
    record = privacy_record(reader)
    heads = ("other stations within 100 m", "changes", "followed", "followed %")
    lines = tuple(
        (
            _range(one),
            formatted_number(one.changes, 0),
            formatted_number(one.linked, 0),
            formatted_number(100 * one.linked / one.changes if one.changes else math.nan, 1),
        )
        for one in record.by_density
    )
    lead = (
        f"Pseudonyms change by {record.strategy.replace('_', ' ')}: a tracker that hears every CAM follows "
        f"{record.linked:,} of {record.changes:,} changes ({formatted_number(100 * record.success, 1)} %) to "
        f"the right pseudonym, and takes {record.mislinked:,} new ones for another station's. It follows a "
        f"station for {formatted_number(100 * record.tracked, 1)} % of its time at a stretch, on average."
    )
    return (
        ReportSection(
            key="privacy",
            title="Privacy: pseudonyms and a tracker",
            lead=lead,
            tables=(Table("The tracker's success by density", heads, lines, NOTE),),
            records=(record,),
            formulas=(FORMULA,),
            terminal=(Table(_overview(record), heads, lines),),
        ),
    )


def _overview(record: PrivacyRecord) -> str:
    """The figure itself, for a terminal."""
    share = formatted_number(100 * record.success, 1)
    return f"Privacy: a tracker follows {record.linked:,} of {record.changes:,} new pseudonyms ({share} %)"


def privacy_record(reader: BagReader) -> PrivacyRecord:
    """The tracker's success on a drive whose stations change their pseudonyms."""
    info: ReceiversInfo = read_scenario_info(reader, ReceiversInfo)
    origin, rules = info.map.origin, info.v2x.pseudonyms
    heard = _heard(reader, Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m))
    links = linked(list(heard.tracks.values()))
    changes = [
        _Change(new, old, heard.neighbours[new])
        for used in heard.used.values()
        for old, new in pairwise(used)
    ]
    right = [links.get(one.pseudonym) == one.before for one in changes]
    successors = {one.pseudonym: one.before for one in changes}
    wrong = sum(successors.get(new) != old for new, old in links.items())
    return PrivacyRecord(
        bag="clean",
        strategy="unknown" if rules is None else rules.strategy,
        stations=len(heard.used),
        changes=len(changes),
        linked=sum(right),
        mislinked=wrong,
        success=sum(right) / len(changes) if changes else math.nan,
        tracked=float(np.mean([_tracked(used, heard.tracks, links) for used in heard.used.values()])),
        neighbours=float(np.mean([one.neighbours for one in changes])) if changes else math.nan,
        by_density=tuple(_by_density(changes, right)),
    )


def _heard(reader: BagReader, geodesy: Geodesy) -> _Heard:
    heard = _Heard()
    for step in read_steps(reader):
        found: list[tuple[int, int, CamCore]] = []
        for one in step.sent:
            try:
                core = core_of_tree(decode_cam_tree(one.payload)) if is_cam(one.payload) else None
            except MessageError:
                core = None
            if core is not None:
                found.append((one.station_id, one.request_ns, core))
        reports = reports_of_cams([core for *_, core in found], [at_ns for _, at_ns, _ in found], geodesy)
        for (radio, _, core), report in zip(found, reports, strict=True):
            if report is None or not math.isfinite(report.yaw_rad + report.speed_mps):
                continue
            sighting = Sighting(report.generation_ns, *report.front_m[:2], report.yaw_rad, report.speed_mps)
            used = heard.used.setdefault(radio, [])
            known = heard.tracks.get(core.station_id)
            if known is None:
                used.append(core.station_id)
                heard.neighbours[core.station_id] = _neighbours(step, radio)
            first = sighting if known is None else known.first
            heard.tracks[core.station_id] = PseudonymTrack(core.station_id, first, sighting)
    return heard


def _neighbours(step: V2xStep, radio: int) -> int:
    places = {one.station_id: one.map_SE3_base[:2, 3] for one in step.radios}
    own = places.pop(radio)
    return sum(float(np.linalg.norm(place - own)) <= NEAR_M for place in places.values())


def _tracked(used: Sequence[int], tracks: Mapping[int, PseudonymTrack], links: Mapping[int, int]) -> float:
    """The longest stretch of a station's use of pseudonyms that the tracker links, as a share of all."""
    begin_ns, end_ns = tracks[used[0]].first.time_ns, tracks[used[-1]].last.time_ns
    longest_ns, since_ns = 0, begin_ns
    for before, pseudonym in zip((None, *used), used, strict=False):
        if before is not None and links.get(pseudonym) != before:
            since_ns = tracks[pseudonym].first.time_ns
        longest_ns = max(longest_ns, tracks[pseudonym].last.time_ns - since_ns)
    return longest_ns / (end_ns - begin_ns) if end_ns > begin_ns else 1.0


def _by_density(changes: Sequence[_Change], right: Sequence[bool]) -> list[DensityRecord]:
    counts, followed = [0] * len(DENSITIES), [0] * len(DENSITIES)
    for change, is_right in zip(changes, right, strict=True):
        place = bisect_right(DENSITIES, change.neighbours) - 1
        counts[place] += 1
        followed[place] += is_right
    ends = [*(least - 1 for least in DENSITIES[1:]), -1]
    return [DensityRecord(*one) for one in zip(DENSITIES, ends, counts, followed, strict=True)]


def _range(record: DensityRecord) -> str:
    least, most = record.neighbours_min, record.neighbours_max
    if most < 0:
        return f"{least} or more"
    return str(least) if least == most else f"{least} to {most}"
