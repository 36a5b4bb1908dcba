"""Shared archives: headers with right checksums, names, sizes, kinds, order, and the list of checksums."""

from __future__ import annotations

import hashlib
import io
import tarfile
from pathlib import Path

from hypothesis import reject
from hypothesis import strategies as st

from advpipe.pipeline.dataset import tar_header
from advpipe.pipeline.dataset.archive import unpack_archive
from tests.fuzz import base, calls
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import TEXTS

ARCHIVE = "town.tar"
NAMES = (
    *(
        "town/../x",
        "/etc/x",
        "town//x",
        "town/./x",
        "town",
        "other/x",
        "town/a\\b",
        "town/con",
        "town/a:b",
        "town/",
    ),
    *(
        "town/" + "d/" * 300 + "x",
        "town/" + "n" * 300,
        "town/e\u0301",
        "town/\x1b[31m",
        "town/SHA256SUMS",
        "town/.",
    ),
    *(f"town/{text}" for text in TEXTS if text != "\ud800"),
)
FIELDS = (
    *(b"77777777777", b"\x80" + b"\0" * 10 + b"\xff", b"-1", b" 0 ", b"00000000000"),
    *(b"x", b"g", b"L", b"1", b"2", b"3", b"5"),
)
"""Octal numbers and others, and the kinds of entries."""


def unpacked(tree: Path, out: Path) -> None:
    unpack_archive(tree / ARCHIVE, out / "town")


CALLS: dict[str, Call] = {
    "unpack": unpacked,
    "verify": lambda tree, out: calls.check(tree / ARCHIVE, out),
}


def with_checksum(block: bytes) -> bytes:
    """A header's block with the sum that it is to have."""
    total = sum(block[:148]) + 8 * 32 + sum(block[156:512])
    return block[:148] + b"%06o\0 " % total + block[156:]


def archive(files: dict[str, bytes], *, add_sums: bool = True, top: str = "town") -> bytes:
    """As `pack` writes it: all files in order, with a list of checksums that is true."""
    if add_sums:
        listed = sorted((name for name in files if name != "SHA256SUMS"), key=str.encode)
        sums = "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in listed)
        files = {**files, "SHA256SUMS": sums.encode(errors="replace")}
    data = b""
    for name in sorted(files, key=str.encode):
        data += tar_header.tar_header(f"{top}/{name}", len(files[name])) + files[name]
        data += bytes(tar_header.padding(len(files[name])))
    end = 2 * tar_header.BLOCK_BYTES
    return data + bytes(end + -(len(data) + end) % tar_header.RECORD_BYTES)


@st.composite
def header_cases(draw: st.DrawFn, data: bytes) -> Case:
    """A header's block changed in some field, with the right checksum again."""
    starts = [place for place in range(0, len(data), 512) if data[place + 257 : place + 262] == b"ustar"]
    start, notes = draw(st.sampled_from(starts)), []
    block = data[start : start + 512]
    for _ in range(draw(st.integers(1, 2))):
        name, first, length = draw(st.sampled_from([
            ("name", 0, 100), ("mode", 100, 8), ("uid", 108, 8), ("size", 124, 12), ("mtime", 136, 12),
            ("kind", 156, 1), ("link", 157, 100), ("magic", 257, 8), ("prefix", 345, 155),
        ]))  # fmt: skip
        value = draw(st.one_of(
            st.sampled_from(FIELDS),
            st.sampled_from(NAMES).map(str.encode), st.binary(max_size=12),
        ))  # fmt: skip
        block = block[:first] + value[:length].ljust(length, b"\0") + block[first + length :]
        notes.append(f"{name} = {value[:20]!r}")
    changed = data[:start] + with_checksum(block) + data[start + 512 :]
    return Case(draw(st.sampled_from(sorted(CALLS))), ARCHIVE, changed, "; ".join(notes))


@st.composite
def content_cases(draw: st.DrawFn, files: dict[str, bytes]) -> Case:
    """Other files or names in an archive whose checksums are all right."""
    files, edit = (
        dict(files),
        draw(st.sampled_from(["name", "name", "content", "sums", "drop", "many", "top"])),
    )
    name = draw(st.sampled_from(sorted(files)))
    top, note = "town", f"{edit} {name}"
    if edit == "name":
        other = draw(st.sampled_from(NAMES)).removeprefix("town/")
        files[other], note = files.pop(name), f"{name} is {other[:40]!r}"
    elif edit == "drop":
        del files[name]
    elif edit == "many":
        files |= {f"many/{number}": b"" for number in range(draw(st.sampled_from([10, 3000])))}
    elif edit == "top":
        top = draw(st.sampled_from(NAMES))
    elif edit == "content":
        files[name] = draw(edited_bytes(files[name]))[0]
    else:
        files["SHA256SUMS"] = draw(edited_bytes(files["SHA256SUMS"]))[0]
    try:
        data = archive(files, add_sums=edit != "sums", top=top)
    except (ValueError, OverflowError):
        reject()
    return Case(draw(st.sampled_from(sorted(CALLS))), ARCHIVE, data, note)


@st.composite
def byte_cases(draw: st.DrawFn, data: bytes) -> Case:
    changed, note = draw(edited_bytes(data))
    return Case(draw(st.sampled_from(sorted(CALLS))), ARCHIVE, changed, note)


def cases(folder: Path) -> st.SearchStrategy[Case]:
    data = (folder / ARCHIVE).read_bytes()
    with tarfile.open(fileobj=io.BytesIO(data)) as whole:
        files = {info.name.partition("/")[2]: whole.extractfile(info).read() for info in whole}  # type: ignore[union-attr]
    return st.one_of(
        header_cases(data), header_cases(data), content_cases(files), content_cases(files), byte_cases(data)
    )


TARGET = Target("tar", base.ARCHIVES, cases, CALLS)
