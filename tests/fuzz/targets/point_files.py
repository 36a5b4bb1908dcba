"""Clouds as files of all formats, with times, poses and boxes as text, as `import files` reads them."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.point_files import read_point_file
from advpipe.stages.import_.run import import_drive
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import NUMBERS, TEXTS

DRIVE = "drive"
HEADER_BYTES = {".pcd": b"DATA ", ".ply": b"end_header", ".npy": b"}"}
"""What ends the header of a format."""

WORDS = (
    *("ascii", "binary", "binary_compressed", "binary_big_endian", "F", "U", "I", "list", "vertex", "float"),
    *("x", "y", "z", "intensity", "ring", "time", "_", "POINTS", "10000000", "-1", "99999999999999999999"),
)


def one_file(tree: Path, out: Path) -> None:
    """Every file of a cloud that the tree has; all but one are those that were changed by nobody."""
    for file in sorted((tree / "clouds").iterdir()):
        read_point_file(file, None, 0.5, 0)


def folder(tree: Path, out: Path) -> str:
    return str(import_drive(ImportRequest("files", tree / DRIVE, ImportOptions()), out / "d"))


CALLS: dict[str, Call] = {"file": one_file, "folder": folder}


@st.composite
def header_cases(draw: st.DrawFn, place: str, data: bytes) -> Case:
    """Words of a header changed, its points as they were, or fewer of them."""
    end = data.index(HEADER_BYTES[Path(place).suffix])
    end = data.find(b"\n", end) + 1 or len(data)
    lines = [line.split(b" ") for line in data[:end].split(b"\n")]
    notes = []
    for _ in range(draw(st.integers(1, 3))):
        line = draw(st.sampled_from(lines))
        spot = draw(st.integers(0, len(line) - 1))
        word = draw(st.one_of(
            st.sampled_from(WORDS), st.sampled_from(NUMBERS).map(str), st.sampled_from(TEXTS),
        )).encode(errors="surrogatepass")  # fmt: skip
        edit = draw(st.sampled_from(["replace", "replace", "drop", "add"]))
        notes.append(f"{edit} {line[spot][:20]!r} {word[:20]!r}")
        line[spot : spot + (edit != "add")] = [] if edit == "drop" else [word]
        if not line:
            line.append(b"")
    head = b"\n".join(b" ".join(line) for line in lines)
    body = data[end:]
    return Case(
        "file", place, head + body[: draw(st.sampled_from([len(body), len(body) // 2]))], "; ".join(notes)
    )


@st.composite
def byte_cases(draw: st.DrawFn, call: str, place: str, data: bytes) -> Case:
    changed, note = draw(edited_bytes(data))
    return Case(call, place, changed, note)


@st.composite
def text_cases(draw: st.DrawFn, place: str, data: bytes) -> Case:
    """A word of a table changed, or a line repeated or dropped."""
    lines = [line.split(" ") for line in data.decode().split("\n")]
    at = draw(st.integers(0, len(lines) - 1))
    edit = draw(st.sampled_from(["word"] * 4 + ["drop", "repeat", "many"]))
    if edit == "word":
        word = draw(st.one_of(st.sampled_from(NUMBERS).map(str), st.sampled_from(TEXTS), st.text(max_size=5)))
        lines[at][draw(st.integers(0, len(lines[at]) - 1))] = word
    else:
        lines[at : at + 1] = [lines[at]] * {"drop": 0, "repeat": 2, "many": 50_000}[edit]
    text = "\n".join(" ".join(line) for line in lines)
    return Case("folder", place, text.encode(errors="surrogatepass"), f"{edit} in line {at + 1}")


def cases(folder: Path) -> st.SearchStrategy[Case]:
    clouds = {f"clouds/{file.name}": file.read_bytes() for file in sorted((folder / "clouds").iterdir())}
    tables = {
        place: (folder / DRIVE / place).read_bytes() for place in ("poses.txt", "times.txt", "labels/0.txt")
    }
    headed = [
        header_cases(place, data) for place, data in clouds.items() if Path(place).suffix in HEADER_BYTES
    ]
    in_bytes = [byte_cases("file", place, data) for place, data in clouds.items()]
    texts = [text_cases(f"{DRIVE}/{place}", data) for place, data in tables.items()]
    first = folder / DRIVE / "0.pcd"
    in_drive = [byte_cases("folder", f"{DRIVE}/0.pcd", first.read_bytes())]
    return st.one_of(*headed, *headed, *in_bytes, *texts, *in_drive)


TARGET = Target("point_files", base.POINTS, cases, CALLS)
