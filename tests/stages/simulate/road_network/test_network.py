"""Networks: what is none is refused before SUMO sees it; geometry agrees with the file."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.map import Generator, Map
from advpipe.stages.simulate.road_network.file import run_sumo, sumo_program
from advpipe.stages.simulate.road_network.network import Edge, endless_edges, load_network

BOULEVARD = load_scenario("boulevard").map
TOWN06 = Path(os.environ.get("ADVPIPE_TOWN06", "Town06.xodr"))

NOT_A_NET = {
    "empty": b"",
    "binary": bytes(range(256)) * 20,
    "text": b"this is no map\n",
    "no_location": b"<net/>",
    "other_xml": b"<routes><vehicle id='a'/></routes>",
    "no_edges": b'<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" '
    b'origBoundary="0,0,1,1" projParameter="!"/></net>',
    "half_an_edge": b'<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" '
    b'origBoundary="0,0,1,1" projParameter="!"/><edge id="a" from="x" to="y"/></net>',
}


@pytest.mark.parametrize("key", ["sumo_net", "opendrive"])
@pytest.mark.parametrize("content", NOT_A_NET.values(), ids=NOT_A_NET.keys())
def test_refuses_invalid_networks(tmp_path: Path, key: str, content: bytes) -> None:
    path = tmp_path / "map.xml"
    path.write_bytes(content)
    with pytest.raises(AdvpipeError, match=r"map\.xml") as caught:
        load_network(Map(**{key: str(path)}), tmp_path)
    assert "\n" not in str(caught.value)


def test_refuses_a_truncated_network(tmp_path: Path) -> None:
    assert BOULEVARD.sumo_net is not None
    whole = Path(BOULEVARD.sumo_net).read_bytes()
    path = tmp_path / "cut.net.xml"
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(AdvpipeError, match="truncated"):
        load_network(Map(sumo_net=str(path)), tmp_path)


def test_refuses_a_missing_file_with_a_hint(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match=r"not exist; give its path with settings map\.opendrive=FILE"):
        load_network(Map(opendrive=str(tmp_path / "Town06.xodr")), tmp_path)


def test_refuses_a_road_with_speed_zero(tmp_path: Path, road: Callable[..., Path]) -> None:
    net = road(100)
    net.write_text(net.read_text().replace('speed="13.90"', 'speed="0.00"'))
    with pytest.raises(AdvpipeError, match=r"road\.net\.xml: edge '\w+' is for cars, but its speed is 0"):
        load_network(Map(sumo_net=str(net)), tmp_path)


def test_refuses_an_opendrive_map_without_roads(tmp_path: Path) -> None:
    path = tmp_path / "empty.xodr"
    path.write_text('<OpenDRIVE><header revMajor="1" revMinor="4" name="none"/></OpenDRIVE>')
    with pytest.raises(AdvpipeError, match=r"empty\.xodr"):
        load_network(Map(opendrive=str(path)), tmp_path)


def test_boulevard_has_the_lanes_of_its_plan(tmp_path: Path) -> None:
    network = load_network(BOULEVARD, tmp_path)
    assert len(network.drivable) == 46
    edge = network.edges["a_b"]
    assert [lane.width_m for lane in edge.lanes] == [3.4, 3.4, 3.4]
    assert set(edge.successors) == {"b_c", "b_bn", "b_bs"}
    # Junction a lies at (-240, -6) and b at (-60, 0): the road between them heads east, and its lanes
    # lie to the right of the line between the two, the outermost first.
    first, last = edge.lanes[0].centre_m, edge.lanes[-1].centre_m
    assert first[0, 0] < first[-1, 0]
    assert np.all(first[:, 1].max() < last[:, 1].min() + 6.0)
    assert first[0, 1] < last[0, 1]
    assert abs(last[0, 1] - first[0, 1]) == pytest.approx(2 * 3.4, abs=0.1)


@pytest.mark.skipif(not TOWN06.is_file(), reason="set ADVPIPE_TOWN06 to CARLA's Town06.xodr")
def test_town06_has_its_known_roads(tmp_path: Path) -> None:
    """93 edges, 20 lane-kilometres, flat; the offset that netconvert adds is taken off again."""
    network = load_network(Map(opendrive=str(TOWN06)), tmp_path)
    assert len(network.edges) == 93
    lane_m = sum(edge.length_m * len(edge.lanes) for edge in network.edges.values())
    assert lane_m == pytest.approx(20_193, abs=10)  # of which 102 m in a hairpin that netconvert cuts short
    assert all(edge.is_true_to_length for edge in network.drivable)
    points = np.concatenate([lane.centre_m for edge in network.edges.values() for lane in edge.lanes])
    assert np.ptp(points[:, 2]) == 0
    assert points[:, 0].min() == pytest.approx(-358, abs=15)


def test_a_geo_referenced_network_keeps_its_own_frame(tmp_path: Path) -> None:
    """Without its offset it would lie at its UTM coordinates, thousands of kilometres away."""
    assert BOULEVARD.sumo_net is not None
    text = Path(BOULEVARD.sumo_net).read_text()
    utm = re.sub(r'netOffset="[^"]*"', 'netOffset="-691000.00,-5334000.00"', text)
    utm = utm.replace(
        'projParameter="!"', 'projParameter="+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m"'
    )
    assert utm.count("+proj=utm") == 1
    path = tmp_path / "utm.net.xml"
    path.write_text(utm)
    network = load_network(Map(sumo_net=str(path)), tmp_path)
    assert np.all(network.offset_m == 0)
    assert np.abs(network.edges["a_b"].lanes[0].centre_m).max() < 2000


def test_lanes_distinguish_cars_and_pedestrians(tmp_path: Path, grid: Callable[..., Path]) -> None:
    """With pavements, a road's first lane is for people on foot and its second for cars."""
    path = grid("--grid.number", "3", "--sidewalks.guess.from-permissions")
    edge = load_network(Map(sumo_net=str(path)), tmp_path).drivable[0]
    assert [lane.for_cars for lane in edge.lanes] == [False, True]
    assert edge.car_lane == 1


def test_edges_that_lead_only_to_dead_ends_are_not_endless() -> None:
    """a and b form a loop, c leads into it; d leads to e, and e leads nowhere."""

    def edge(name: str, *successors: str) -> Edge:
        return Edge(name, (), 100.0, 10.0, True, successors)

    edges = [edge("a", "b", "d"), edge("b", "a"), edge("c", "a"), edge("d", "e"), edge("e")]
    assert endless_edges(edges) == {"a", "b", "c"}
    assert endless_edges(edges[3:]) == set()


@pytest.mark.parametrize("kind", ["grid", "spider", "random"])
def test_a_generated_network_follows_from_its_seed(tmp_path: Path, kind: str) -> None:
    source = Map(generator=Generator(kind=kind, size=4))  # type: ignore[arg-type]
    networks = []
    for seed in (7, 7, 8):
        networks.append(load_network(source, tmp_path, seed))
        networks[-1].sumo_file.unlink()
    assert networks[0].map_sha256 == networks[1].map_sha256
    assert (networks[2].map_sha256 != networks[0].map_sha256) == (kind == "random")
    assert len(endless_edges(networks[0].drivable)) > 10
    assert {len(edge.lanes) for edge in networks[0].drivable} == {2}


def test_a_generated_grid_has_the_configured_size(tmp_path: Path) -> None:
    """3 x 3 junctions 200 m apart: 12 roads, both ways."""
    network = load_network(Map(generator=Generator(size=3, block_m=200, lanes=1, speed_mps=10)), tmp_path)
    assert len(network.drivable) == 24
    points = np.concatenate([edge.lanes[0].centre_m for edge in network.drivable])
    assert np.ptp(points[:, :2], axis=0) == pytest.approx([400, 400], abs=10)
    assert {edge.speed_mps for edge in network.drivable} == {10}


def test_lane_lines_exclude_pavements_and_include_junctions(tmp_path: Path) -> None:
    """Lane :a_1_0 of the boulevard begins at (187.04, 167.74); the network's offset is (420, 165)."""
    network = load_network(BOULEVARD, tmp_path)
    begins_m = np.array([middle_m[0, :2] for middle_m, _ in network.lanes_m])
    nearest_m = np.linalg.norm(begins_m - [187.04 - 420, 167.74 - 165], axis=1).min()
    assert nearest_m < 0.01
    assert all(len(middle_m) > 1 and 1 < width_m < 6 for middle_m, width_m in network.lanes_m)
    edge = network.drivable[0]
    outer, *others = edge.lanes
    pavement = replace(edge, lanes=(replace(outer, is_pavement=True), *others))
    fewer = replace(network, edges=network.edges | {edge.id: pavement})
    assert len(fewer.lanes_m) == len(network.lanes_m) - 1


def test_the_digest_is_that_of_the_map_file(tmp_path: Path) -> None:
    assert BOULEVARD.sumo_net is not None
    expected = hashlib.sha256(Path(BOULEVARD.sumo_net).read_bytes()).hexdigest()
    assert load_network(BOULEVARD, tmp_path).map_sha256 == expected


def test_an_opendrive_map_without_signals_gets_traffic_lights(tmp_path: Path) -> None:
    """Written by netconvert from the boulevard, whose four crossings have lights; then without them."""
    assert BOULEVARD.sumo_net is not None
    whole, dark = tmp_path / "with.xodr", tmp_path / "without.xodr"
    command = [sumo_program("netconvert"), "-s", BOULEVARD.sumo_net, "--opendrive-output", str(whole)]
    subprocess.run(command, check=True, capture_output=True)
    text = re.sub(r"<signals>.*?</signals>|<controller .*?</controller>", "", whole.read_text(), flags=re.S)
    dark.write_text(text)
    assert "<signal " in whole.read_text()
    assert "<signal " not in text
    for path in (whole, dark):
        network = load_network(Map(opendrive=str(path)), tmp_path)
        lights = {link.light[0] for edge in network.drivable for link in edge.connections if link.light}
        assert len(lights) >= 4


RISING = """<?xml version="1.0"?>
<OpenDRIVE{namespace}>
  <header revMajor="1" revMinor="4" name="rising"/>
  <road name="r" length="200" id="1" junction="-1">
    <type s="0" type="town"/>
    <planView><geometry s="0" x="{x}" y="0" hdg="0" length="200"><line/></geometry></planView>
    <elevationProfile>
      <elevation s="0" a="0" b="0" c="0" d="0"/>
      <elevation s="100" a="0" b="0.05" c="0" d="0"/>
    </elevationProfile>
    <lanes><laneSection s="0">
      <center><lane id="0" type="none" level="false"/></center>
      <right>
        <lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        <lane id="-2" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
      </right>
    </laneSection></lanes>
  </road>
</OpenDRIVE>
"""
"""Flat for 100 m, then rising by 5 %: netconvert writes its first points without z."""

REPEAT = """</planView>
    <objects><object id="1"><repeat s="0" length="{length}" distance="{distance}"/></object></objects>
"""


@pytest.mark.parametrize("namespace", ["", ' xmlns="http://www.opendrive.org"'])
def test_an_opendrive_road_that_begins_flat_and_climbs(tmp_path: Path, namespace: str) -> None:
    path = tmp_path / "rising.xodr"
    path.write_text(RISING.format(namespace=namespace, x=0))
    network = load_network(Map(opendrive=str(path)), tmp_path)
    (edge,) = network.drivable
    text = network.sumo_file.read_text()
    assert re.search(r'shape="[-.0-9]+,[-.0-9]+ [^"]*[-.0-9]+,[-.0-9]+,[.0-9]+"', text)  # with and without z
    assert len(edge.lanes) == 2
    for lane in edge.lanes:
        assert lane.centre_m[[0, -1], 2] == pytest.approx([0, 5], abs=0.05)
        assert np.interp(100, lane.centre_m[:, 0], lane.centre_m[:, 2]) == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('length="200"><line', 'length="2147483647"><line', "a <geometry> has the length '2147483647'"),
        ('length="200"><line', 'length="1e999"><line', "a <geometry> has the length '1e999'"),
        ("</planView>", REPEAT.format(length="10", distance="-1"), "a <repeat> has the distance '-1'"),
        ("</planView>", REPEAT.format(length="1e5", distance="1e-9"), "with 1.* repeated objects; at most"),
    ],
)
def test_refuses_too_large_opendrive_maps(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "long.xodr"
    text = RISING.format(namespace="", x=0)
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(AdvpipeError, match=complaint):
        load_network(Map(opendrive=str(path)), tmp_path)


def test_a_map_far_from_its_origin_keeps_the_networks_frame(tmp_path: Path) -> None:
    """Of UTM coordinates without a projection, float32 would leave steps of half a metre."""
    path = tmp_path / "far.xodr"
    path.write_text(RISING.format(namespace="", x=5_300_000))
    network = load_network(Map(opendrive=str(path)), tmp_path)
    assert np.all(network.offset_m == 0)
    assert np.abs(network.drivable[0].lanes[0].centre_m).max() < 300


def test_a_program_that_never_ends_is_stopped() -> None:
    with pytest.raises(AdvpipeError, match=r"m\.xodr: sumo did not finish with it within 0\.001 s"):
        run_sumo("sumo", ["--help"], "m.xodr", timeout_s=0.001)


def test_connections_join_the_lanes_that_they_name(tmp_path: Path) -> None:
    network = load_network(BOULEVARD, tmp_path)
    links = [(edge, link) for edge in network.drivable for link in edge.connections]
    assert len(links) > 100
    for edge, link in links:
        there = network.edges[link.to_edge]
        assert link.centre_m[0] == pytest.approx(edge.lanes[link.from_lane].centre_m[-1], abs=0.1)
        assert link.centre_m[-1] == pytest.approx(there.lanes[link.to_lane].centre_m[0], abs=0.1)
