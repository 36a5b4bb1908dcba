"""Labels beside adversarial bags: what verify, export and evaluate read of others' tables."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from tests.fuzz import base, calls
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.targets.tables import edited_parquet

PLACES = (
    "cam/v2x_labels.parquet",
    "gnss/gnss_labels.parquet",
    "gnss/v2x_labels.parquet",
    "detach/labels.parquet",
    "detach/frames.parquet",
)
BAGS = ("cam", "gnss", "detach")


def _call(command: str, bag: str) -> Call:
    if command == "evaluate":
        return lambda tree, out: calls.evaluated(tree / "clean", tree / bag, out)
    return lambda tree, out: {"verify": calls.check, "export": calls.export}[command](tree / bag, out)


WORDS = ("verify", "export", "evaluate")
CALLS: dict[str, Call] = {f"{command} {bag}": _call(command, bag) for bag in BAGS for command in WORDS}


@st.composite
def label_cases(draw: st.DrawFn, files: dict[str, bytes]) -> Case:
    place = draw(st.sampled_from(PLACES))
    command = draw(st.sampled_from(["verify"] * 4 + ["export"] * 4 + ["evaluate"]))
    data, note = draw(edited_parquet(files[place]))
    return Case(f"{command} {place.partition('/')[0]}", place, data, note)


def cases(folder: Path) -> st.SearchStrategy[Case]:
    return label_cases({place: (folder / place).read_bytes() for place in PLACES})


TARGET = Target("parquet", base.DRIVE, cases, CALLS, smoke_inputs=25)
