"""Detectors' files: advpipe's safetensors, and files of torch.save for `import-weights`."""

from __future__ import annotations

import io
import json
import pickle
import struct
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import torch
from hypothesis import reject
from hypothesis import strategies as st

from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.family import SecondFamily
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import JSON_RAWS, TEXTS, document, edited_trees, scalars

OURS, THEIRS = "small.safetensors", "second.pth"
BOMB_BYTES = (1 << 20, 3 << 30, 3 << 30)
"""Zeros, which deflate packs a thousand times."""


def load(tree: Path, out: Path) -> None:
    load_detector(str(tree / OURS))


def convert(tree: Path, out: Path) -> None:
    SecondFamily().import_weights(tree / THEIRS)


CALLS: dict[str, Call] = {"load": load, "import": convert}


def safetensors(header: Any, tensors: bytes) -> bytes:
    """A file with this header, as JSON."""
    text = document(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + tensors


@st.composite
def our_cases(draw: st.DrawFn, data: bytes) -> Case:
    """Mutations of the header, of the metadata about the network, and of the weights."""
    (length,) = struct.unpack_from("<Q", data)
    header, tensors = json.loads(data[8 : 8 + length]), data[8 + length :]
    edit = draw(st.sampled_from(["about", "about", "about", "header", "header", "numbers", "bytes"]))
    if edit == "about":
        about, note = draw(edited_trees(json.loads(header["__metadata__"]["advpipe"]), JSON_RAWS))
        header["__metadata__"]["advpipe"] = document(about)
        return Case("load", OURS, safetensors(header, tensors), note)
    if edit == "header":
        short = dict(list(header.items())[: draw(st.sampled_from([2, 5, len(header)]))])
        changed, note = draw(edited_trees(short, JSON_RAWS))
        full = {**header, **changed} if isinstance(changed, dict) else changed
        return Case("load", OURS, safetensors(full, tensors), note)
    if edit == "numbers":
        place = draw(st.integers(0, len(tensors) // 2 - 1)) * 2
        pattern = draw(st.sampled_from([b"\xff\x7f", b"\x00\x7c", b"\x00\xfc", b"\x01\x00"]))
        changed = tensors[:place] + pattern + tensors[place + 2 :]
        return Case("load", OURS, safetensors(header, changed), f"{pattern.hex()} at {place}")
    changed, note = draw(edited_bytes(data[: 8 + length]))
    return Case("load", OURS, changed + tensors, note)


ENTRY_NAMES = [text for text in TEXTS[:-2] if text.partition("\0")[0] not in ("", "\ud800")]
"""Names that `zipfile` writes."""


def torch_file(entries: dict[str, bytes], bomb: str = "", bomb_bytes: int = 0) -> bytes:
    """The zip of torch.save; `bomb` names an entry that is zeros, deflated in a third of the usual time."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, data in entries.items():
            if name != bomb:
                file.writestr(name, data, zipfile.ZIP_STORED)
                continue
            with file.open(name, "w", force_zip64=True) as entry:
                for _ in range(max(bomb_bytes >> 20, 1)):
                    entry.write(bytes(1 << 20))
    return stream.getvalue()


@lru_cache(8)
def bomb(entries: tuple[tuple[str, bytes], ...], name: str, size_bytes: int) -> bytes:
    """Packing so many zeros takes seconds."""
    return torch_file(dict(entries), name, size_bytes)


PICKLES = (
    *(
        pickle.dumps(value, 2)
        for value in (None, 1, [], {}, {"model_state": None}, {"model_state": []}, "x" * 1000)
    ),
    pickle.dumps({"model_state": {1: 2}}, 2),
    b"\x80\x02" + b"]" * 5000 + b"a" * 4999 + b".",
    b"\x80\x02cos\nsystem\n(X\x01\x00\x00\x00:tR.",
    b"\x80\x02c__builtin__\neval\n(X\x01\x00\x00\x001tR.",
    b"\x80\x02ctorch\nFloatStorage\nq\x00.",
    b"\x80\x02}(K\x01K\x02u.",
    b"\x80\x02\x8c\xff.",
    b"\x80\x02X\xff\xff\xff\x7f.",
    b"(dp0\n.",
)


@st.composite
def their_cases(draw: st.DrawFn, entries: dict[str, bytes]) -> Case:
    """Entries of the zip, the pickle in it, and zeros that were packed."""
    entries, name = dict(entries), draw(st.sampled_from(sorted(entries)))
    edit = draw(
        st.sampled_from(["pickle", "pickle", "pickle", "entry", "drop", "rename", "bomb", "bytes", "state"])
    )
    pickled = next(entry for entry in entries if entry.endswith("data.pkl"))
    note = f"{edit} {name}"
    if edit == "pickle":
        other = draw(
            st.one_of(st.sampled_from(PICKLES), edited_bytes(entries[pickled]).map(lambda made: made[0]))
        )
        entries[pickled], note = other, f"another pickle: {other[:30]!r}"
    elif edit == "entry":
        entries[name] = draw(edited_bytes(entries[name]))[0]
    elif edit == "drop":
        del entries[name]
    elif edit == "rename":
        entries[draw(st.sampled_from(ENTRY_NAMES))] = entries.pop(name)
    elif edit == "bomb":
        large = [entry for entry in sorted(entries) if "/data" in entry]  # what is read as a whole
        name, size = draw(st.sampled_from(large)), draw(st.sampled_from(BOMB_BYTES))
        data = bomb(tuple(sorted(entries.items())), name, size)
        return Case("import", THEIRS, data, f"{name} unpacks to {size} bytes")
    elif edit == "state":
        return Case("import", THEIRS, *draw(other_states()))
    data = torch_file(entries)
    if edit == "bytes":
        data, note = draw(edited_bytes(data))
    return Case("import", THEIRS, data, note)


@st.composite
def other_states(draw: st.DrawFn) -> tuple[bytes, str]:
    """What torch.save makes of other values."""
    names = st.sampled_from(["model_state", "epoch", "backbone_3d.conv_input.0.weight", *TEXTS[:9]])
    tensors = st.sampled_from([
        torch.zeros(3), torch.zeros(1).expand(1 << 20, 1 << 20), torch.zeros(2, dtype=torch.int64),
        torch.tensor(1j),         torch.zeros(2).to_sparse(),
        torch.quantize_per_tensor(torch.zeros(2), 0.1, 0, torch.qint8), torch.zeros(0),
    ])  # fmt: skip
    plain = st.one_of(tensors, scalars())
    value = draw(
        st.one_of(plain, st.fixed_dictionaries({"model_state": st.dictionaries(names, plain, max_size=3)}))
    )
    stream = io.BytesIO()
    try:
        torch.save(value, stream)
    except Exception:  # what torch does not save
        reject()
    return stream.getvalue(), f"saved {value!r:.80}"


def cases(folder: Path) -> st.SearchStrategy[Case]:
    with zipfile.ZipFile(folder / THEIRS) as file:
        entries = {name: file.read(name) for name in file.namelist()}
    return st.one_of(our_cases((folder / OURS).read_bytes()), their_cases(entries))


TARGET = Target("checkpoint", base.WEIGHTS, cases, CALLS, smoke_inputs=20)
