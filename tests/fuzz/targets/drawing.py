"""Figures of a report: elements, attributes and entities of SVG."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from advpipe.stages.evaluate.report.figures import export_figures
from tests.fuzz import base
from tests.fuzz.case import Case, Target
from tests.fuzz.targets.network import network_cases

SVG = "figures/one.svg"


def export(tree: Path, out: Path) -> None:
    """`advpipe figures --format pdf`."""
    export_figures(tree, "pdf", out / "pdf")


def cases(folder: Path) -> st.SearchStrategy[Case]:
    return network_cases(("figures",), SVG, (folder / SVG).read_bytes())


TARGET = Target("drawing", base.REPORT, cases, {"figures": export}, smoke_inputs=10)
