"""Regression inputs made by changing a file of another format: databases and road networks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.fuzz import base
from tests.fuzz.case import Case
from tests.fuzz.targets import network, recording


def database(change: str, *values: object) -> Callable[[Path], Case]:
    """A recording in SQLite with something else in a column."""

    def make(folder: Path) -> Case:
        import sqlite3
        import tempfile

        with tempfile.NamedTemporaryFile(suffix=".db3") as file:
            Path(file.name).write_bytes((folder / base.RECORDINGS / recording.SQLITE).read_bytes())
            opened = sqlite3.connect(file.name)
            opened.execute(f"UPDATE messages SET {change} WHERE id = 4", values)
            opened.commit()
            opened.close()
            return Case("sqlite", recording.SQLITE, Path(file.name).read_bytes())

    return make


def lane_shapes(call: str, shape: str) -> Callable[[Path], Case]:
    """A network in which the first lane of each edge has another shape."""

    def make(folder: Path) -> Case:
        import xml.etree.ElementTree as ElementTree

        tree = ElementTree.fromstring((folder / base.NETWORKS / network.SUMO).read_bytes())
        for edge in tree.iter("edge"):
            if edge.get("function") != "internal":
                edge[0].set("shape", shape)
        return Case(call, network.SUMO, ElementTree.tostring(tree))

    return make


def long_curves(folder: Path) -> Case:
    """An OpenDRIVE map whose curves go around the Earth."""
    import xml.etree.ElementTree as ElementTree

    tree = ElementTree.fromstring((folder / base.NETWORKS / network.OPENDRIVE).read_bytes())
    for geometry in tree.iter("geometry"):
        geometry.set("length", "2147483647")
    return Case("opendrive", network.OPENDRIVE, ElementTree.tostring(tree))
