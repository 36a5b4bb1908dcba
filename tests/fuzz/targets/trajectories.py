"""The user's table of trajectories, as text and as Parquet."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from advpipe.stages.simulate.traffic.trajectories.table import read_trajectory_table
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.targets.tables import edited_parquet
from tests.fuzz.values import NUMBERS, TEXTS

TEXT, PARQUET = "poses.csv", "poses.parquet"
BODIES = frozenset({"sedan", "suv"})
LONGEST_ROWS = 500_000


def _table(name: str) -> Call:
    return lambda tree, out: read_trajectory_table(tree / name, BODIES) and None


CALLS = {"csv": _table(TEXT), "parquet": _table(PARQUET)}


@st.composite
def text_cases(draw: st.DrawFn, data: bytes) -> Case:
    """A cell, a line or bytes changed; now and then very many lines."""
    edit = draw(st.sampled_from(["cell"] * 6 + ["line", "line", "bytes", "rows", "encoding"]))
    if edit == "bytes":
        changed, note = draw(edited_bytes(data))
        return Case("csv", TEXT, changed, note)
    if edit == "encoding":
        codec = draw(st.sampled_from(["utf-8-sig", "utf-16", "utf-32"]))
        return Case("csv", TEXT, data.decode().encode(codec), codec)
    lines = data.decode().splitlines()
    place = draw(st.integers(0, len(lines) - 1))
    if edit == "rows":
        count = draw(st.sampled_from([1000, LONGEST_ROWS]))
        return Case("csv", TEXT, "\n".join([*lines, *[lines[-1]] * count]).encode(), f"{count} more rows")
    if edit == "line":
        lines[place : place + 1] = draw(
            st.sampled_from([[], [lines[place]] * 2, [""], ['"'], [","] * 3, lines[::-1]])
        )
    else:
        cells = lines[place].split(",")
        value = draw(
            st.one_of(st.sampled_from(NUMBERS).map(str), st.sampled_from(TEXTS), st.text(max_size=5))
        )
        cells[draw(st.integers(0, len(cells) - 1))] = value
        lines[place] = ",".join(cells)
    return Case("csv", TEXT, "\n".join(lines).encode(errors="surrogatepass"), f"{edit} in line {place + 1}")


def cases(folder: Path) -> st.SearchStrategy[Case]:
    table = edited_parquet((folder / PARQUET).read_bytes())
    of_parquet = table.map(lambda made: Case("parquet", PARQUET, *made))
    return st.one_of(text_cases((folder / TEXT).read_bytes()), of_parquet)


TARGET = Target("trajectories", base.TABLES, cases, CALLS)
