"""Verify on shared data sets: flipped bits, files and their list, signatures, archives, the command."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from first_words import without_progress
from found_checks import checks_of

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset import archive, checksums, signature
from advpipe.pipeline.viewer_layouts.files import NAMES
from advpipe.stages.verify.run import verify


def test_every_flipped_bit_is_found(shared: Path) -> None:
    """60 of them anywhere in a data set, all found; the benchmark does so a thousand times."""
    rng = np.random.default_rng(5)
    files = [shared / name for name in (*checksums.listed_files(shared), checksums.FILE)]
    sizes = np.array([path.stat().st_size for path in files])
    ends = np.cumsum(sizes)
    for place in rng.integers(ends[-1], size=60).tolist() + [int(ends[-1]) - 3, int(ends[-1]) - 40]:
        index = int(np.searchsorted(ends, place, side="right"))
        offset = place - int(ends[index] - sizes[index])
        flip(files[index], offset, int(rng.integers(8)))
        assert not verify(shared, quick=True).is_good, (files[index], offset)
        flip(files[index], offset, None)
    assert verify(shared, quick=True).is_good


_before: dict[Path, bytes] = {}


def flip(path: Path, offset: int, bit: int | None) -> None:
    """Turn one bit over; None puts the file back."""
    if bit is None:
        path.write_bytes(_before.pop(path))
        return
    data = _before.setdefault(path, path.read_bytes())
    path.write_bytes(data[:offset] + bytes([data[offset] ^ 1 << bit]) + data[offset + 1 :])


@pytest.mark.parametrize("name", ["clean", "gnss"])
def test_every_flipped_bit_of_a_single_bag_is_found(data_set: Path, tmp_path: Path, name: str) -> None:
    """What the bag says of itself finds them all, without SHA256SUMS: CRCs, strict records, its memory."""
    bag = Path(shutil.move(data_set / name, tmp_path / "alone"))
    rng = np.random.default_rng(6)
    mcap = next(bag.glob("*.mcap"))
    small = [path for path in sorted(bag.iterdir()) if path != mcap and path.name not in NAMES]
    size = mcap.stat().st_size
    places = [(mcap, int(p)) for p in [*rng.integers(size, size=12), 3, 12, size - 2, size - 20, size - 35]]
    places += [(path, int(rng.integers(path.stat().st_size))) for path in small for _ in range(2)]
    for path, offset in places:
        flip(path, offset, int(rng.integers(8)))
        result = verify(bag, quick=path == mcap)
        assert not result.is_good, (path, offset)
        flip(path, offset, None)


def test_a_changed_layout_of_a_single_bag_is_not_checked(data_set: Path) -> None:
    """Layouts follow from the bag, which lists no checksum of them: another release may write others."""
    layout = data_set / "clean" / NAMES[0]
    layout.write_bytes(layout.read_bytes() + b" ")
    result = verify(data_set / "clean")
    assert result.is_good
    assert f"clean/{NAMES[0]}: no checksum protects it" in "\n".join(map(str, result.unchecked))


@pytest.mark.parametrize("spoil", ["missing", "unlisted", "list"])
def test_missing_and_unlisted_files_are_faults(shared: Path, spoil: str) -> None:
    if spoil == "missing":
        (shared / "detach" / "frames.parquet").unlink()
    elif spoil == "unlisted":
        (shared / "more.txt").write_text("x")
    else:
        (shared / checksums.FILE).write_text("nonsense")
    found = verify(shared, quick=True).findings
    where = {"missing": "detach/frames.parquet", "unlisted": "more.txt", "list": checksums.FILE}[spoil]
    assert [(finding.check, finding.where) for finding in found] == [("checksums", where)]


def test_hidden_files_are_not_part_of_a_data_set(shared: Path) -> None:
    """As `git` and what fetches from Hugging Face leave them."""
    (shared / ".cache").mkdir()
    (shared / ".cache" / "x").write_text("x")
    result = verify(shared, quick=True)
    assert result.is_good
    assert [gap.what for gap in result.unchecked] == [
        ".cache/x is hidden and not listed; not part of the data set"
    ]


def test_files_that_were_not_shared_are_not_faults(data_set: Path) -> None:
    """Without a list, though, nobody can tell."""
    (data_set / "scenario.yaml").unlink()
    assert checks_of(data_set) == {"scenario"}
    checksums.write(data_set)
    result = verify(data_set)
    assert result.is_good
    assert "scenario.yaml: was not shared [scenario]" in map(str, result.unchecked)


def test_a_data_set_with_only_its_checksum_list_is_faulty(shared: Path) -> None:
    shutil.rmtree(shared / "clean")
    found = verify(shared).findings
    assert {finding.where for finding in found} == {
        *("clean/clean_0.mcap", "clean/metadata.yaml"),
        *(f"clean/{name}" for name in NAMES),
    }


def test_without_the_library_a_signature_is_not_checked(
    shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (shared / signature.FILE).write_bytes(bytes(64))
    (shared / signature.KEY_FILE).write_text("x")
    checksums.write(shared)
    for name in [name for name in sys.modules if name.split(".")[0] == "cryptography"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    result = verify(shared, quick=True)
    assert result.is_good
    assert "pip install 'advpipe[sign]'" in result.unchecked[0].what


def test_valid_and_invalid_signatures_are_distinguished(shared: Path, tmp_path: Path) -> None:
    keys = []
    for name in ("a", "b"):
        private, public = tmp_path / f"{name}.pem", tmp_path / f"{name}.pub.pem"
        command = ["openssl", "genpkey", "-algorithm", "ed25519", "-out", str(private)]
        subprocess.run(command, check=True)
        subprocess.run(["openssl", "pkey", "-in", private, "-pubout", "-out", public], check=True)
        keys.append((private, public))
    assert not verify(shared, quick=True, key=keys[0][1]).is_good  # not signed at all
    signature.sign_folder(shared, keys[0][0])
    assert verify(shared, quick=True, key=keys[0][1]).is_good
    found = verify(shared, quick=True, key=keys[1][1]).findings
    assert [finding.check for finding in found] == ["signature"]
    with pytest.raises(AdvpipeError, match="private key"):
        verify(shared, key=keys[0][0])


def test_an_archive_is_verified(shared: Path, tmp_path: Path) -> None:
    (path, *_) = archive.pack(archive.contents(shared), tmp_path / "drive.tar")
    assert verify(path, quick=True).is_good
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    assert [finding.check for finding in verify(path).findings] == ["archive"]


def test_the_command_prints_findings(shared: Path) -> None:
    code = "from advpipe.pipeline.cli import app; app()"
    command = [sys.executable, "-c", code, "verify", str(shared), "--quick", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["good"] is True
    flip(shared / "scenario.yaml", 5, 0)
    done = subprocess.run(command[:-1], capture_output=True, text=True)
    assert done.returncode == 1
    assert without_progress(done.stderr) == ""
    first, last = done.stdout.splitlines()
    assert first == "scenario.yaml: does not match its SHA-256 in SHA256SUMS [checksums]"
    assert last.endswith(": 1 finding")
