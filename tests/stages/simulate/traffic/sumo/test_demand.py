"""Vehicles that route files make, counted by hand."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.traffic.sumo.demand import MOST_LISTED, check_demand, departures, seconds

END_S = 100.0

FLOWS = {
    'begin="0" end="50" number="10"': 10,
    'begin="0" end="1000" number="1000000000"': 1e8,
    'begin="0" end="200" number="10"': 5,
    'begin="50" end="150" number="10"': 5,
    'begin="200" end="300" number="10"': 0,
    'begin="10" end="10" number="7"': 7,
    'number="1000000000"': 1e9,
    'begin="0" vehsPerHour="3600"': 101,
    'begin="0" perHour="7200" number="20"': 20,
    'begin="90" period="0.5"': 21,
    'begin="0" period="exp(2)"': 201,
    'begin="0" probability="1e9"': 1e11 + 1,
    'begin="0" period="0"': math.inf,
    'begin="0:01:00" period="0:0:2"': 21,
    'begin="0" number="many"': math.inf,
    'begin="0"': 0,
    'begin="0" number="-3" period="1"': 0,
    'begin="0" period="nan"': 1,
}


@pytest.mark.parametrize(("attributes", "count"), FLOWS.items())
def test_departures_of_flows(attributes: str, count: float) -> None:
    assert departures(ElementTree.fromstring(f"<flow {attributes}/>"), None, END_S) == pytest.approx(count)


def test_a_flow_in_an_interval_uses_its_times() -> None:
    root = ElementTree.fromstring(
        '<routes><interval begin="0" end="50"><flow number="1e9"/></interval></routes>'
    )
    interval = root[0]
    assert departures(interval[0], interval, END_S) == 1e9
    with pytest.raises(AdvpipeError, match="a: 1,000,000,000 vehicles would depart during the drive"):
        check_demand([root], "a", END_S)


def test_vehicles_and_flows_of_all_files_add_up() -> None:
    vehicle = '<vehicle id="v" depart="1"/><trip id="t" depart="2"/><vehicle id="late" depart="200"/>'
    files = [
        ElementTree.fromstring(f"<routes>{text}</routes>")
        for text in (vehicle, '<flow end="100" number="99998"/>')
    ]
    check_demand(files, "a", END_S)
    with pytest.raises(AdvpipeError, match="a: 100,001 vehicles would depart"):
        check_demand([*files, ElementTree.fromstring('<r><trip depart="triggered"/></r>')], "a", END_S)


def test_vehicles_that_depart_later_are_read_too() -> None:
    root = ElementTree.Element("routes")
    root.extend([ElementTree.Element("vehicle", depart="1e6")] * (MOST_LISTED + 1))
    with pytest.raises(AdvpipeError, match="a: lists more than 500,000 vehicles"):
        check_demand([root], "a", END_S)


def test_sumo_times_are_parsed() -> None:
    assert seconds("1:00:01", 0) == 3601
    assert seconds("1:0:0:1", 0) == 86401
    assert seconds("2.5", 0) == 2.5
    assert seconds("soon", 7) == seconds(None, 7) == seconds("1:2", 7) == 7
