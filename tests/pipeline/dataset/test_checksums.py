import hashlib
import shutil
import subprocess
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.dataset import checksums

# Of FIPS 180-2: the message "abc".
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    (folder / "clean").mkdir(parents=True)
    (folder / "clean" / "b c.mcap").write_bytes(b"abc")
    (folder / "clean.txt").write_bytes(b"")
    (folder / "ä").write_bytes(b"x")
    checksums.write(folder)
    return folder


def test_a_list_says_what_is_there(folder: Path) -> None:
    sums = checksums.read(folder)
    # "." sorts before "/", and both before what is beyond ASCII
    assert list(sums) == ["clean.txt", "clean/b c.mcap", "ä"]
    assert sums["clean/b c.mcap"] == sha256_of(folder / "clean" / "b c.mcap") == ABC
    assert checksums.to_text(sums).encode() == (folder / "SHA256SUMS").read_bytes()


def test_a_signature_is_not_listed(folder: Path) -> None:
    (folder / "SHA256SUMS.sig").write_bytes(b"x")
    assert checksums.listed_files(folder) == list(checksums.read(folder))


@pytest.mark.oracle
@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum")
def test_sha256sum_reads_and_writes_the_same(folder: Path) -> None:
    run = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    assert subprocess.run(run, cwd=folder, capture_output=True).returncode == 0
    theirs = subprocess.run(["sha256sum", *checksums.read(folder)], cwd=folder, capture_output=True).stdout
    assert theirs == (folder / "SHA256SUMS").read_bytes()
    (folder / "clean.txt").write_bytes(b"changed")
    assert subprocess.run(run, cwd=folder, capture_output=True).returncode == 1


LINE = f"{ABC}  a"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINE, ":1: the last line has no line end"),
        (f"{LINE}\n{LINE}\n", ":2: 'a' is listed twice"),
        (f"{ABC}  b\n{LINE}\n", ":2: 'a' is listed twice or out of order"),
        (f"{ABC.upper()}  a\n", ":1: expected a line of `sha256sum`"),
        (f"{ABC} *a\n", ":1: expected a line of `sha256sum`"),
        (f"{ABC[1:]}  a\n", ":1: expected a line of `sha256sum`"),
        (f"{LINE}\n\n", ":2: expected a line of `sha256sum`"),
        (f"{LINE}\r\n", "is not the path of a file"),
        (f"{ABC}  ../a\n", ":1: '../a' is not the path of a file in this folder"),
        (f"{ABC}  a/../../b\n", "is not the path of a file"),
        (f"{ABC}  /etc/passwd\n", "is not the path of a file"),
        (f"{ABC}  a//b\n", "is not the path of a file"),
        (f"{ABC}  ./a\n", "is not the path of a file"),
        (f"{ABC}  a\\b\n", "is not the path of a file"),
        (f"{ABC}  SHA256SUMS\n", "is not the path of a file"),
    ],
)
def test_anything_else_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "SHA256SUMS").write_bytes(text.encode())
    with pytest.raises(AdvpipeError) as error:
        checksums.read(tmp_path)
    assert message in str(error.value)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "SHA256SUMS").write_bytes(f"{LINE}\n{ABC}  ".encode() + b"\xff\n")
    with pytest.raises(AdvpipeError, match=":2: no UTF-8"):
        checksums.read(tmp_path)
    (tmp_path / "SHA256SUMS").unlink()
    with pytest.raises(AdvpipeError, match="does not exist"):
        checksums.read(tmp_path)


def test_every_flipped_bit_of_a_list_shows(folder: Path) -> None:
    """It is refused, or says something else about a file than that file does."""
    path = folder / "SHA256SUMS"
    good = path.read_bytes()
    true = {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name in checksums.listed_files(folder)
    }
    assert checksums.parse_checksums(good, path) == true
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        try:
            assert checksums.parse_checksums(bytes(bad), path) != true
        except AdvpipeError:
            continue


def test_names_that_a_list_cannot_hold_and_links_are_refused(folder: Path) -> None:
    (folder / "new\nline").touch()
    with pytest.raises(AdvpipeError, match="rename it"):
        checksums.write(folder)
    (folder / "new\nline").unlink()
    (folder / "link").symlink_to("/etc/passwd")
    with pytest.raises(AdvpipeError, match="is a link"):
        checksums.write(folder)
