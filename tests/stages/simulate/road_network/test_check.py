"""A network with one thing wrong: one line that names the element, before anything is built on it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.map import Map
from advpipe.stages.simulate.road_network.network import load_network

Element = ElementTree.Element


def lane(net: Element) -> Element:
    found = net.find("edge[@id='ab']/lane")
    assert found is not None
    return found


def first(net: Element, tag: str) -> Element:
    found = net.find(tag)
    assert found is not None
    return found


def again(net: Element, element: Element) -> None:
    net.append(ElementTree.fromstring(ElementTree.tostring(element)))


WRONG: dict[str, tuple[Callable[[Element], object], str]] = {
    "huge speed": (
        lambda net: lane(net).set("speed", "1e308"),
        r"lane 'ab_0' has speed '1e308', not a number",
    ),
    "NaN": (lambda net: lane(net).set("length", "nan"), r"lane 'ab_0' has length 'nan'"),
    "no number": (lambda net: lane(net).set("width", "wide"), r"lane 'ab_0' has width 'wide'"),
    "no speed": (lambda net: lane(net).attrib.pop("speed"), r"lane 'ab_0' has no speed"),
    "no shape": (lambda net: lane(net).attrib.pop("shape"), r"lane 'ab_0' has no shape"),
    "empty shape": (lambda net: lane(net).set("shape", ""), r"lane 'ab_0' has a shape of 0 points"),
    "one point": (lambda net: lane(net).set("shape", "1,2"), r"lane 'ab_0' has a shape of 1 points"),
    "four coordinates": (lambda net: lane(net).set("shape", "1,2,3,4 5,6"), r"is not a list of x,y or x,y,z"),
    "huge shape": (lambda net: lane(net).set("shape", "0,0 1e308,0"), r"a coordinate that is not a number"),
    "NaN in a shape": (lambda net: lane(net).set("shape", "0,0 nan,0"), r"a coordinate that is not a number"),
    "endless lane": (
        lambda net: lane(net).set("shape", "0,0 5.1e6,0"),
        r"lanes and outlines are \d+ km long",
    ),
    "far lane": (lambda net: lane(net).set("shape", "2e6,0 2.0001e6,0"), r"edge 'ab' lies more than 100 km"),
    "edge twice": (lambda net: again(net, first(net, "edge[@id='ab']")), r"edge 'ab' occurs twice"),
    "lane twice": (lambda net: first(net, "edge[@id='ab']").append(lane(net)), r"lane 'ab_0' occurs twice"),
    "junction twice": (
        lambda net: again(net, first(net, "junction[@id='b']")),
        r"junction 'b' occurs twice",
    ),
    "junction at infinity": (
        lambda net: first(net, "junction").set("x", "-inf"),
        r"junction '\w' has x '-inf'",
    ),
    "junction without lanes": (lambda net: first(net, "junction").attrib.pop("intLanes"), r"has no intLanes"),
    "connection to lane -1": (
        lambda net: first(net, "connection").set("toLane", "-1"),
        r"<connection> from '\w+' to '\w+' has toLane '-1'",
    ),
    "connection to nowhere": (
        lambda net: first(net, "connection").set("to", "nowhere"),
        r"SUMO cannot load the network: .*nowhere",
    ),
    "offset": (lambda net: first(net, "location").set("netOffset", "0"), r"<location> has netOffset '0'"),
    "no version": (lambda net: net.attrib.pop("version"), r"<net> has no version"),
    "a long value": (
        lambda net: lane(net).set("speed", "9" * 100_000),
        r"has speed '9+\.\.\.9+', not a number",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_an_error_names_the_element(tmp_path: Path, road: Callable[..., Path], wrong: str) -> None:
    change, expected = WRONG[wrong]
    tree = ElementTree.parse(road(100))
    change(tree.getroot())
    path = tmp_path / "wrong.net.xml"
    tree.write(path, encoding="utf-8")
    with pytest.raises(AdvpipeError) as caught:
        load_network(Map(sumo_net=str(path)), tmp_path)
    message = str(caught.value)
    assert re.search(expected, message), message
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < len(str(path)) + 200


def test_an_endless_connection_over_a_junction_is_refused(tmp_path: Path, road: Callable[..., Path]) -> None:
    """The inner lane of a turn leads to itself."""
    tree = ElementTree.parse(road(100))
    inner = next(link for link in tree.getroot().iter("connection") if str(link.get("from")).startswith(":"))
    inner.set("via", f"{inner.get('from')}_{inner.get('fromLane')}")
    path = tmp_path / "ring.net.xml"
    tree.write(path, encoding="utf-8")
    with pytest.raises(AdvpipeError, match=r"ring\.net\.xml: .*(never ends|SUMO cannot load)"):
        load_network(Map(sumo_net=str(path)), tmp_path)
