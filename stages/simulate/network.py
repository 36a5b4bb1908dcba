"""The road network: an OpenDRIVE or SUMO file, checked before SUMO sees it, with its geometry."""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.map import Map

CAR = "passenger"


@dataclass(frozen=True)
class Lane:
    """One lane; `centre_m` (K, 3) runs along the driving direction in the map's frame."""

    centre_m: Float64
    width_m: float
    for_cars: bool


@dataclass(frozen=True)
class Edge:
    """A one-way road between two junctions; lanes from the right-hand side to the left."""

    id: str
    lanes: tuple[Lane, ...]
    length_m: float
    speed_mps: float
    for_cars: bool
    successors: tuple[str, ...]

    @property
    def car_lane(self) -> int:
        """Index of the outermost lane that cars may use: pavements and cycle lanes lie outside of it."""
        return [lane.for_cars for lane in self.lanes].index(True)

    @property
    def width_m(self) -> float:
        return sum(lane.width_m for lane in self.lanes)


@dataclass(frozen=True)
class RoadNetwork:
    """The file that SUMO drives on, and its geometry in the map's frame.

    The map's frame is that of the road map which the network was made from: map = network -
    `offset_m`. A geo-referenced network keeps its own frame (a zero offset): without its offset it
    would lie thousands of kilometres from its origin, where float32 has steps of half a metre.
    """

    sumo_file: Path
    offset_m: Float64
    edges: dict[str, Edge]
    junctions_m: tuple[Float64, ...]

    @property
    def drivable(self) -> list[Edge]:
        """Edges that cars may use, in a fixed order."""
        return [edge for _, edge in sorted(self.edges.items()) if edge.for_cars]


def endless_edges(edges: list[Edge]) -> set[str]:
    """The edges from which a drive can go on for ever: those that lead to no other such edge drop out."""
    endless = {edge.id for edge in edges}
    while True:
        lasting = {edge.id for edge in edges if edge.id in endless and endless & set(edge.successors)}
        if lasting == endless:
            return endless
        endless = lasting


def load_network(source: Map, scratch: Path) -> RoadNetwork:
    """Checks and reads the network of a scenario; converted files go to the `scratch` folder."""
    if source.opendrive is not None:
        sumo_file = _convert_opendrive(Path(source.opendrive), scratch)
        origin = Path(source.opendrive)
    else:
        assert source.sumo_net is not None
        sumo_file = origin = Path(source.sumo_net)
        _check_xml(origin, "map.sumo_net", "net", "a SUMO network (.net.xml)")
    root = ElementTree.parse(sumo_file).getroot()
    if root.find("location") is None:
        raise AdvpipeError(
            f"{origin}: no <location> in it, so it is no complete SUMO network; run netconvert"
        )
    if not any(not edge.get("id", ":").startswith(":") for edge in root.iter("edge")):
        raise AdvpipeError(f"{origin}: the network holds no road")
    _probe(sumo_file, origin)
    network = _read(sumo_file, origin)
    if not network.drivable:
        raise AdvpipeError(f"{origin}: the network has no lane that cars may use")
    return network


def _check_xml(path: Path, key: str, root_tag: str, kind: str) -> None:
    if not path.is_file():
        hint = f"give its path with --set {key}=FILE"
        raise AdvpipeError(f"{key}: {path} {'is no file' if path.exists() else 'does not exist'}; {hint}")
    if path.stat().st_size == 0:
        raise AdvpipeError(f"{key}: {path} is empty")
    try:
        tag = ElementTree.parse(path).getroot().tag
    except (ElementTree.ParseError, ValueError, UnicodeError, LookupError) as error:
        raise AdvpipeError(f"{key}: {path} is not {kind}, or is cut off: {error}") from None
    if tag != root_tag:
        raise AdvpipeError(f"{key}: {path} is not {kind}: its root element is <{tag}>, not <{root_tag}>")


def _convert_opendrive(path: Path, scratch: Path) -> Path:
    _check_xml(path, "map.opendrive", "OpenDRIVE", "an OpenDRIVE map (.xodr)")
    out = scratch / "network.net.xml"
    command = ["--opendrive-files", str(path), "--output-file", str(out), "--no-warnings"]
    done = subprocess.run([sumo_program("netconvert"), *command], capture_output=True, text=True)
    if done.returncode != 0 or not out.is_file():
        raise AdvpipeError(f"{path}: netconvert cannot read it: {_last_error(done)}")
    return out


def _probe(sumo_file: Path, origin: Path) -> None:
    """Lets SUMO load the network in a process of its own: a file that crashes it must not crash us."""
    command = ["--net-file", str(sumo_file), "--begin", "0", "--end", "0.1", "--no-step-log", "--no-warnings"]
    done = subprocess.run([sumo_program("sumo"), *command], capture_output=True, text=True)
    if done.returncode != 0:
        raise AdvpipeError(f"{origin}: SUMO cannot load the network: {_last_error(done)}")


def _last_error(done: subprocess.CompletedProcess[str]) -> str:
    if done.returncode < 0:
        return f"it crashed with signal {-done.returncode}"
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip().startswith("Error")]
    return re.sub(r"^Error:\s*", "", lines[0]) if lines else f"exit code {done.returncode}"


def sumo_program(name: str) -> str:
    """The path of a SUMO program that came with the eclipse-sumo package."""
    import sumo

    return str(Path(sumo.SUMO_HOME) / "bin" / name)


def _read(sumo_file: Path, origin: Path) -> RoadNetwork:
    import sumolib

    try:
        net = sumolib.net.readNet(str(sumo_file), withInternal=False)
        offset = np.array([*net.getLocationOffset(), 0.0], dtype=np.float64) * (not net.hasGeoProj())
        edges = {}
        for edge in net.getEdges(withInternal=False):
            lanes = tuple(
                Lane(
                    np.array(lane.getShape3D(), dtype=np.float64) - offset,
                    float(lane.getWidth()),
                    bool(lane.allows(CAR)),
                )
                for lane in edge.getLanes()
            )
            successors = [next_edge for next_edge in edge.getAllowedOutgoing(CAR) if next_edge.allows(CAR)]
            edges[edge.getID()] = Edge(
                edge.getID(),
                lanes,
                float(edge.getLength()),
                float(edge.getSpeed()),
                bool(edge.allows(CAR)),
                tuple(sorted(next_edge.getID() for next_edge in successors)),
            )
        junctions = tuple(
            np.array([(*point[:2], point[2] if len(point) > 2 else 0.0) for point in node.getShape3D()])
            - offset
            for node in net.getNodes()
            if len(node.getShape3D()) >= 3
        )
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as error:
        raise AdvpipeError(f"{origin}: the network cannot be read: {error!r}") from None
    if not all(np.isfinite(lane.centre_m).all() for edge in edges.values() for lane in edge.lanes):
        raise AdvpipeError(f"{origin}: the network has coordinates that are not finite")
    return RoadNetwork(sumo_file, offset, edges, junctions)
