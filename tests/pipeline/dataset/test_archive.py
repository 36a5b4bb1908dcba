import io
import os
import random
import shutil
import subprocess
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.archive import Limits, contents, pack, unpack_archive
from advpipe.pipeline.dataset.lay_out import write_folder
from advpipe.pipeline.dataset.layout import read_layout

NAMES = ("README.md", "clean/clean_0.mcap", "clean/metadata.yaml", "figures/größe.png", "e/" * 60 + "empty")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "town"
    draws = random.Random(1)
    for place, name in enumerate(NAMES):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(draws.randbytes(1500 * (4 - place)))
    checksums.write(folder)
    return folder


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {name: path.read_bytes() for name, path in contents(folder).items()}


def test_what_goes_in_comes_out(tmp_path: Path, folder: Path) -> None:
    made = pack(contents(folder), tmp_path / "town.tar")
    assert [path.name for path in made] == ["town.tar", "town.tar.sha256"]
    assert unpack_archive(made[0], tmp_path / "new") == tmp_path / "new"
    assert bytes_of(tmp_path / "new") == bytes_of(folder)
    shutil.copytree(folder, tmp_path / "again", copy_function=shutil.copyfile)  # other times
    (tmp_path / "other").mkdir()
    again = pack(contents(tmp_path / "again"), tmp_path / "other" / "town.tar")
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in made]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_the_bytes_are_tarfiles(tmp_path: Path, folder: Path) -> None:
    (made, _) = pack(contents(folder), tmp_path / "town.tar")
    theirs = io.BytesIO()
    with tarfile.open(fileobj=theirs, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for name, data in bytes_of(folder).items():
            info = tarfile.TarInfo(f"town/{name}")
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    assert made.read_bytes() == theirs.getvalue()


@pytest.mark.oracle
@pytest.mark.skipif(not (shutil.which("tar") and shutil.which("sha256sum")), reason="no tar or sha256sum")
def test_tar_unpacks_parts_and_sha256sum_checks_them(tmp_path: Path, folder: Path) -> None:
    made = pack(contents(folder), tmp_path / "town.tar", 10_240)
    assert [path.name for path in made[:3]] == ["town.tar.000", "town.tar.001", "town.tar.002"]
    assert {path.stat().st_size for path in made[:-2]} == {10_240}
    check = ["sha256sum", "--check", "--strict", made[-1].name]
    assert subprocess.run(check, cwd=tmp_path, capture_output=True).returncode == 0
    (tmp_path / "there").mkdir()
    joined = b"".join(part.read_bytes() for part in made[:-1])
    command = ["tar", "--extract", "--directory", str(tmp_path / "there")]
    assert subprocess.run(command, input=joined, capture_output=True).returncode == 0
    assert bytes_of(tmp_path / "there" / "town") == bytes_of(folder)
    # Any part means the whole; the archive's name is the folder's.
    folder.rename(tmp_path / "old")
    assert unpack_archive(made[1]) == folder
    assert bytes_of(folder) == bytes_of(tmp_path / "old")


def refused(archive: Path, message: str, **limits: int) -> None:
    out = archive.parent / "out"
    with pytest.raises(AdvpipeError, match=message):
        unpack_archive(archive, out, Limits(**limits))
    assert not out.exists()
    assert not [path for path in archive.parent.iterdir() if path.name.startswith(".")]


def test_a_flipped_bit_anywhere_is_found(tmp_path: Path, folder: Path) -> None:
    for name in NAMES[1:3]:
        (folder / name).unlink()
    checksums.write(folder)
    archive, sums = pack(contents(folder), tmp_path / "town.tar")
    good, draws = archive.read_bytes(), random.Random(2)
    stated = sums.read_bytes()
    for number in range(40):
        sums.write_bytes(stated)
        if number % 2:
            sums.unlink()  # the archive itself tells
        bad = bytearray(good)
        bad[draws.randrange(len(bad))] ^= 1 << draws.randrange(8)
        archive.write_bytes(bad)
        refused(archive, "town.tar")
    archive.write_bytes(good)
    for place in range(0, len(stated), 7):
        bad = bytearray(stated)
        bad[place] ^= 1 << draws.randrange(8)
        sums.write_bytes(bad)
        refused(archive, "town.tar")


def test_what_is_truncated_or_missing_is_reported(tmp_path: Path, folder: Path) -> None:
    archive, sums = pack(contents(folder), tmp_path / "town.tar")
    good = archive.read_bytes()
    sums.unlink()
    for length in (0, 100, 512, 5000, len(good) - 10_000, len(good) - 1):
        archive.write_bytes(good[:length])
        refused(archive, "truncated")
    for garbage in (b"x", bytes(512), bytes(10_240)):
        archive.write_bytes(good + garbage)
        refused(archive, "there is data after the archive's end")
    archive.unlink()
    refused(archive, "nor ")
    parts = pack(contents(folder), archive, 10_240)[:-1]
    for part, message in (
        (parts[0], "town.tar.000 is missing"),
        (parts[1], "town.tar.001 is missing"),
        (parts[-1], "lists town.tar.000, .* not the parts"),
    ):
        part.rename(tmp_path / "away")
        refused(archive, message)
        (tmp_path / "away").rename(part)
    whole = parts[1].read_bytes()
    parts[1].write_bytes(whole[:-1])
    refused(archive, "town.tar.001 differs in size from town.tar.000")
    parts[1].write_bytes(whole)
    (tmp_path / "town.tar.sha256").unlink()
    parts[-1].unlink()
    refused(archive, "truncated")
    archive.write_bytes(good)
    refused(archive, "both ")


def member(name: str, kind: bytes = tarfile.REGTYPE, data: bytes = b"x", link: str = "") -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.size, info.linkname, info.mode = kind, len(data), link, 0o644
    return info


HOSTILE: dict[str, tuple[list[tarfile.TarInfo], str]] = {
    "up": ([member("town/../../evil")], "is outside the data set's folder"),
    "absolute": ([member("/tmp/evil")], "is outside the data set's folder"),
    "no folder": ([member("evil")], "is outside the data set's folder"),
    "two folders": ([member("a/x"), member("b/y")], "is outside the data set's folder"),
    "twice": ([member("town/a"), member("town/a")], "comes twice or out of order"),
    "file as folder": ([member("town/a"), member("town/a/b")], "comes twice on this file system"),
    "our lock": ([member("town/.lock")], "comes twice on this file system"),
    "symbolic link": ([member("town/a", tarfile.SYMTYPE, b"", "/etc")], "is not what `advpipe share` writes"),
    "hard link": (
        [member("town/a", tarfile.LNKTYPE, b"", "/etc/passwd")],
        "is not what `advpipe share` writes",
    ),
    "device": ([member("town/a", tarfile.CHRTYPE, b"")], "is not what `advpipe share` writes"),
    "pipe": ([member("town/a", tarfile.FIFOTYPE, b"")], "is not what `advpipe share` writes"),
    "sparse": ([member("town/a", tarfile.GNUTYPE_SPARSE, b"")], "is not what `advpipe share` writes"),
    "control sign": ([member("town/a\x1b[2J")], "is outside the data set's folder"),
    "backslash": ([member("town\\..\\evil/a")], "is outside the data set's folder"),
    "drive letter": ([member("town/C:evil")], "is outside the data set's folder"),
    "long name": ([member("town/" + "a/" * 5000 + "a")], "is not what `advpipe share` writes"),
    "deep folders": ([member("town/" + "a/" * 1900 + "a")], "more than 100 levels deep"),
    "nothing": ([], "holds no SHA256SUMS"),
    "no list": ([member("town/a")], "holds no SHA256SUMS"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_archives_are_refused(tmp_path: Path, kind: str) -> None:
    members, message = HOSTILE[kind]
    archive = tmp_path / "evil.tar"
    with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as stream:
        for info in members:
            stream.addfile(info, io.BytesIO(b"x" * info.size))
    refused(archive, message)
    assert [path.name for path in tmp_path.iterdir()] == ["evil.tar"]


def test_deep_folders_are_refused(tmp_path: Path, folder: Path) -> None:
    """As another tool unpacks them; Python's recursion ends at a thousand."""
    descriptor = os.open(folder, os.O_RDONLY)
    for _ in range(1500):
        os.mkdir("a", dir_fd=descriptor)
        below = os.open("a", os.O_RDONLY, dir_fd=descriptor)
        os.close(descriptor)
        descriptor = below
    os.close(descriptor)
    for look in (contents, read_layout):
        with pytest.raises(AdvpipeError, match="more than 100 levels deep"):
            look(folder)
    subprocess.run(["rm", "-r", folder / "a"], check=True)
    assert read_layout(folder).leftovers == ()


def test_limits_and_declared_sizes_hold(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, _ = pack(contents(folder), tmp_path / "town.tar")
    refused(archive, "more than 3 files", files=3)
    refused(archive, "the limit is 1000", bytes=1000)
    huge = tmp_path / "huge.tar"
    for size_bytes in (10**15, 8**11 - 1, 20_000):
        info = member("town/a")
        info.size = size_bytes
        huge.write_bytes(info.tobuf(tarfile.PAX_FORMAT) + bytes(10_240))
        refused(huge, f"town/a has {size_bytes} bytes, more than the archive")
    usage = shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    refused(archive, "1000 are free; make room")


def test_a_list_that_does_not_fit_is_refused(tmp_path: Path, folder: Path) -> None:
    (folder / "extra").write_text("")
    archive, _ = pack_anyway(folder, tmp_path / "town.tar")
    refused(archive, "extra does not match SHA256SUMS")
    checksums.write(folder)
    (folder / "extra").unlink()
    archive, _ = pack_anyway(folder, archive)
    refused(archive, "extra is missing, though SHA256SUMS lists it")


def pack_anyway(folder: Path, archive: Path) -> tuple[Path, None]:
    """As somebody with another tool would, who packs equal headers."""
    with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as stream:
        for name, data in bytes_of(folder).items():
            stream.addfile(member(f"town/{name}", data=data), io.BytesIO(data))
    return archive, None


def test_outputs_are_not_replaced_unasked(tmp_path: Path, folder: Path) -> None:
    archive = tmp_path / "town.tar"
    parts = pack(contents(folder), archive, 10_240)
    with pytest.raises(AdvpipeError, match=r"town\.tar\.000 already exists"):
        pack(contents(folder), archive)
    pack(contents(folder), archive, overwrite=True)
    assert not any(part.exists() for part in parts[:-1])
    with pytest.raises(AdvpipeError, match="town already exists"):
        unpack_archive(archive)
    with pytest.raises(AdvpipeError, match="is a folder; give the archive"):
        unpack_archive(folder)
    with pytest.raises(AdvpipeError, match=r"^\. is a folder; give the archive"):
        unpack_archive(Path())
    with pytest.raises(AdvpipeError, match=r"must end in \.tar"):
        pack(contents(folder), tmp_path / "town.zip")
    with pytest.raises(AdvpipeError, match="no characters that paths reserve"):
        pack(contents(folder), tmp_path / "a\nb.tar")
    with pytest.raises(AdvpipeError, match="too small"):
        pack(contents(folder), tmp_path / "b.tar", 100)


@pytest.mark.parametrize(
    "change", [lambda path: path.write_bytes(b"new"), lambda path: path.write_bytes(b"")]
)
def test_a_file_that_changes_meanwhile_stops_the_packing(
    tmp_path: Path, folder: Path, change: Callable[[Path], object]
) -> None:
    change(folder / "README.md")
    with pytest.raises(AdvpipeError, match=r"README\.md changed while it was packed"):
        pack(contents(folder), tmp_path / "town.tar")
    assert [path.name for path in tmp_path.iterdir()] == ["town"]


def test_files_and_their_list_must_fit(tmp_path: Path, folder: Path) -> None:
    files = contents(folder)
    with pytest.raises(AdvpipeError, match=r"README\.md is missing, though it lists it"):
        pack({name: path for name, path in files.items() if name != "README.md"}, tmp_path / "a.tar")
    with pytest.raises(AdvpipeError, match="more is not listed"):
        write_folder({**files, "more": files["README.md"]}, tmp_path / "a")
    assert [path.name for path in tmp_path.iterdir()] == ["town"]


def test_a_laid_out_folder_is_the_same(tmp_path: Path, folder: Path) -> None:
    write_folder(contents(folder), tmp_path / "new")
    assert bytes_of(tmp_path / "new") == bytes_of(folder)
    with pytest.raises(AdvpipeError, match="new already exists"):
        write_folder(contents(folder), tmp_path / "new")
    (folder / "README.md").write_text("other", encoding="utf-8")
    with pytest.raises(AdvpipeError, match=r"README\.md changed while it was copied"):
        write_folder(contents(folder), tmp_path / "newer")
    assert not (tmp_path / "newer").exists()
