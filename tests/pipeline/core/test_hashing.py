"""SHA-256 by the example of FIPS 180-2: the message "abc"."""

from __future__ import annotations

import io
from pathlib import Path

from advpipe.pipeline.core.hashing import copy, sha256_of

ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_the_hash_covers_concatenated_files(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"a")
    (tmp_path / "bc").write_bytes(b"bc")
    assert sha256_of(tmp_path / "a", tmp_path / "bc") == ABC


def test_a_copy_ends_at_the_size_or_at_the_end_of_the_source() -> None:
    out = io.BytesIO()
    assert copy(io.BytesIO(b"abcdef").read, out.write, 3) == (ABC, 3)
    assert out.getvalue() == b"abc"
    assert copy(io.BytesIO(b"abc").read, io.BytesIO().write, 10) == (ABC, 3)
