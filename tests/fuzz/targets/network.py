"""Road networks of SUMO and OpenDRIVE: elements, shapes, numbers, names and entities of XML."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from hypothesis import strategies as st

from advpipe.pipeline.scenario.map import Map
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.road_network.repair import repair_lanes
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import NUMBERS, TEXTS

SUMO, OPENDRIVE = "town.net.xml", "town.xodr"
ENTITIES = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10 if n else "lol"}">' for n in range(10))
LAUGHS = f"<!DOCTYPE net [{ENTITIES}]>"
OUTSIDE = '<!DOCTYPE net [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
SHAPES = (
    "",
    "0,0",
    "0,0 0,0",
    "0,0 1,1,1",
    "1e308,0 -1e308,0",
    "nan,0 1,1",
    "0,0,0 1,1",
    "a,b",
    "0,0 1",
    ",,",
    "0 0",
)


def _load(key: str, name: str) -> Call:
    def call(tree: Path, out: Path) -> None:
        with tempfile.TemporaryDirectory() as scratch:
            load_network(Map.model_validate({key: str(tree / name)}), Path(scratch), 1)

    return call


def drive(tree: Path, out: Path) -> None:
    """A tenth of a second in a world that is built along the network."""
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.simulate.run import simulate

    changes = ("simulation.duration_s=0.1", "simulation.warmup_s=0", f"map.sumo_net={tree / SUMO}")
    simulate(load_scenario("smoke", [*base.SETTINGS, *changes]), out / "drive")


def repaired(tree: Path, out: Path) -> None:
    """The repair of a map after netconvert; only for seeds, as netconvert writes no such file on demand."""
    repair_lanes(tree / SUMO)


CALLS: dict[str, Call] = {
    "repair": repaired,
    "simulate": drive,
    "sumo": _load("sumo_net", SUMO),
    "opendrive": _load("opendrive", OPENDRIVE),
}


@st.composite
def network_cases(draw: st.DrawFn, calls: tuple[str, ...], name: str, data: bytes) -> Case:
    """Elements and attributes changed; now and then bytes."""
    call = draw(st.sampled_from(calls))
    if draw(st.integers(0, 5)) == 0:
        changed, note = draw(edited_bytes(data))
        return Case(call, name, changed, note)
    tree, notes = ElementTree.fromstring(data), []
    for _ in range(draw(st.integers(1, 3))):
        element = draw(st.sampled_from(list(tree.iter())))
        edit = draw(st.sampled_from(["value"] * 6 + ["drop", "drop child", "repeat child", "tag"]))
        if edit == "value" and element.attrib:
            key = draw(st.sampled_from(sorted(element.attrib)))
            values = [*map(str, NUMBERS), *SHAPES, *(text for text in TEXTS[:-1] if text.isprintable())]
            element.set(key, draw(st.sampled_from(values)))
            notes.append(f"{element.tag}.{key} = {element.get(key)!r:.40}")
        elif edit == "drop" and element.attrib:
            del element.attrib[draw(st.sampled_from(sorted(element.attrib)))]
        elif edit == "tag":
            element.tag = draw(st.sampled_from(["net", "edge", "lane", "junction", "OpenDRIVE", "x"]))
        elif len(element):
            child = element[draw(st.integers(0, len(element) - 1))]
            if edit == "repeat child":
                element.append(child)
            else:
                element.remove(child)
        notes.append(f"{edit} of {element.tag}")
    text = ElementTree.tostring(tree, encoding="unicode")
    if draw(st.integers(0, 15)) == 0:
        text = draw(st.sampled_from([LAUGHS, OUTSIDE])) + text.replace(">", ">&e9;", 1)
        notes.append("entities")
    return Case(call, name, text.encode(errors="replace"), "; ".join(notes))


def cases(folder: Path) -> st.SearchStrategy[Case]:
    net, xodr = (folder / SUMO).read_bytes(), (folder / OPENDRIVE).read_bytes()
    sumo = network_cases(("sumo", "sumo", "simulate"), SUMO, net)
    return st.one_of(sumo, sumo, network_cases(("opendrive",), OPENDRIVE, xodr))


TARGET = Target("network", base.NETWORKS, cases, CALLS, smoke_inputs=10)
