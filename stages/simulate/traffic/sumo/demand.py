"""The number of vehicles in the user's route files, counted before SUMO creates them."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator

from advpipe.pipeline.core.errors import AdvpipeError

MOST_DEPARTURES = 100_000
"""Within one drive: the traffic of a large city in its busiest hour. SUMO needs a few kilobytes for each
vehicle, and checks those that wait for room in every step."""

MOST_LISTED = 500_000
"""Vehicles and trips listed one by one, including those that depart later: SUMO reads all at its start."""

_EXPONENTIAL = re.compile(r"exp\(([^)]*)\)")


def check_demand(roots: Iterable[ElementTree.Element], where: str, end_s: float) -> None:
    """Raise AdvpipeError if too many vehicles are listed, or depart by the drive's end."""
    listed, departing = 0, 0.0
    for root in roots:
        for found in root.iter():
            if found.tag in ("vehicle", "trip"):
                listed += 1
                departing += seconds(found.get("depart", "0"), 0.0) <= end_s
        for flow, interval in _flows(root):
            departing += departures(flow, interval, end_s)
        if listed > MOST_LISTED:
            raise AdvpipeError(
                f"{where}: lists more than {MOST_LISTED:,} vehicles, too many for SUMO to hold; "
                "remove those that depart after the drive"
            )
        if departing > MOST_DEPARTURES:
            raise AdvpipeError(
                f"{where}: {_amount(departing)} vehicles would depart during the drive; at most "
                f"{MOST_DEPARTURES:,} are simulated, as SUMO holds and moves each of them; reduce the flows"
            )


def departures(flow: ElementTree.Element, interval: ElementTree.Element | None, end_s: float) -> float:
    """The number of vehicles of a <flow> that depart until `end_s`; SUMO itself refuses invalid numbers."""
    times = flow if interval is None else interval
    begin_s = seconds(flow.get("begin") or times.get("begin"), 0.0)
    until_s = seconds(flow.get("end") or times.get("end"), max(begin_s, end_s))
    most, rate_hz = max(_number(flow.get("number"), math.inf), 0.0), _rate_hz(flow)
    open_s = min(until_s, end_s) - begin_s
    if open_s < 0:
        return 0.0
    if rate_hz is None:  # `number` vehicles, evenly between begin and end
        if flow.get("number") is None:
            return 0.0
        return most * open_s / (until_s - begin_s) if until_s > begin_s else most
    return most if rate_hz == math.inf else min(most, 1 + open_s * rate_hz)


def seconds(text: str | None, otherwise: float) -> float:
    """Parse a SUMO time: seconds, or [days:]hours:minutes:seconds."""
    parts = [_number(part, math.nan) for part in (text or "").split(":")]
    scales = {1: (1,), 3: (3600, 60, 1), 4: (86400, 3600, 60, 1)}.get(len(parts))
    if scales is None or any(map(math.isnan, parts)):
        return otherwise
    return sum(part * scale for part, scale in zip(parts, scales, strict=True))


def _flows(root: ElementTree.Element) -> Iterator[tuple[ElementTree.Element, ElementTree.Element | None]]:
    """Every <flow>, and the <interval> that contains it, if any."""
    within = {id(flow): interval for interval in root.iter("interval") for flow in interval.iter("flow")}
    for flow in root.iter("flow"):
        yield flow, within.get(id(flow))


def _rate_hz(flow: ElementTree.Element) -> float | None:
    """The rate of a flow; None for one that has only a number of vehicles."""
    for name, scale in (("vehsPerHour", 3600.0), ("perHour", 3600.0), ("probability", 1.0)):
        if flow.get(name) is not None:
            return max(_number(flow.get(name), 0.0), 0.0) / scale
    period = flow.get("period")
    if period is None:
        return None
    if exponential := _EXPONENTIAL.fullmatch(period.strip()):
        return max(_number(exponential[1], 0.0), 0.0)
    period_s = seconds(period, math.inf)
    return 1 / period_s if period_s > 0 else math.inf


def _number(text: str | None, otherwise: float) -> float:
    try:
        number = float(text) if text is not None else otherwise
    except ValueError:
        return otherwise
    return otherwise if math.isnan(number) else number


def _amount(count: float) -> str:
    return "infinitely many" if count == math.inf else f"{count:,.0f}" if count < 1e15 else f"{count:.0e}"
