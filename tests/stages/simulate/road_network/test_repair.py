"""The inner lane of a hairpin bend, cut off by netconvert, is laid beside its neighbour again."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from advpipe.stages.simulate.road_network.repair import repair_lanes

NET = """<net>
  <edge id=":j_0" function="internal">
    <lane id=":j_0_0" index="0" length="2.00" shape="100.00,-1.60 102.00,-1.60"/>
    <lane id=":j_0_1" index="1" length="97.00" shape="5.00,1.60 102.00,1.60"/>
  </edge>
  <edge id="e" from="i" to="j">
    <lane id="e_0" index="0" length="52.50" width="3.20" shape="0.00,-1.60 100.00,-1.60"/>
    <lane id="e_1" index="1" length="52.50" width="3.20" shape="0.00,1.60 5.00,1.60"/>
  </edge>
  <edge id="f" from="j" to="k">
    <lane id="f_0" index="0" length="50.00" shape="102.00,-1.60 152.00,-1.60"/>
    <lane id="f_1" index="1" length="50.00" shape="102.00,1.60 152.00,1.60"/>
  </edge>
  <connection from="e" to="f" fromLane="0" toLane="0" via=":j_0_0"/>
  <connection from="e" to="f" fromLane="1" toLane="1" via=":j_0_1"/>
</net>"""


def test_a_truncated_lane_and_its_connection_are_repaired(tmp_path: Path) -> None:
    path = tmp_path / "n.net.xml"
    path.write_text(NET)
    assert repair_lanes(path) == 1
    lanes = {lane.get("id"): lane for lane in ElementTree.parse(path).getroot().iter("lane")}
    assert lanes["e_1"].get("shape") == "0.00,1.60 100.00,1.60"
    assert {lanes[name].get("length") for name in ("e_0", "e_1")} == {"100.00"}
    assert lanes[":j_0_1"].get("shape") == "100.00,1.60 102.00,1.60"
    assert float(lanes[":j_0_1"].get("length", "nan")) == pytest.approx(2.0)
    assert lanes[":j_0_0"].get("shape") == "100.00,-1.60 102.00,-1.60"


def test_an_intact_network_is_not_changed(tmp_path: Path) -> None:
    path = tmp_path / "n.net.xml"
    path.write_text(NET.replace("0.00,1.60 5.00,1.60", "0.00,1.60 100.00,1.60"))
    before = path.read_bytes()
    assert repair_lanes(path) == 0
    assert path.read_bytes() == before


def test_a_repaired_lane_follows_the_bend_at_its_distance(tmp_path: Path) -> None:
    """A half circle of 20 m radius to the left; its inner lane lies on 16.8 m."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 60)
    bend = " ".join(f"{20 * np.cos(a):.2f},{20 * np.sin(a):.2f}" for a in angle)
    text = NET.replace("0.00,-1.60 100.00,-1.60", bend).replace(
        "0.00,1.60 5.00,1.60", "0.00,-16.80 1.00,-16.80"
    )
    path = tmp_path / "n.net.xml"
    path.write_text(text)
    assert repair_lanes(path) == 1
    lane = next(lane for lane in ElementTree.parse(path).getroot().iter("lane") if lane.get("id") == "e_1")
    points = np.array([[float(v) for v in point.split(",")] for point in str(lane.get("shape")).split()])
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.full(60, 16.8), abs=0.05)


def test_a_lane_that_begins_flat_and_climbs(tmp_path: Path) -> None:
    """z is named where it is not 0: a sound network is left alone, and a lane that was cut off climbs too."""
    climbing = NET.replace("0.00,-1.60 100.00,-1.60", "0.00,-1.60 50.00,-1.60 100.00,-1.60,3.00")
    sound, cut = tmp_path / "sound.net.xml", tmp_path / "cut.net.xml"
    sound.write_text(climbing.replace("0.00,1.60 5.00,1.60", "0.00,1.60 50.00,1.60 100.00,1.60,3.00"))
    cut.write_text(climbing)
    before = sound.read_bytes()
    assert repair_lanes(sound) == 0
    assert sound.read_bytes() == before
    assert repair_lanes(cut) == 1
    lanes = {lane.get("id"): lane for lane in ElementTree.parse(cut).getroot().iter("lane")}
    assert lanes["e_1"].get("shape") == "0.00,1.60 50.00,1.60 100.00,1.60,3.00"
    assert lanes[":j_0_1"].get("shape") == "100.00,1.60,3.00 102.00,1.60"
