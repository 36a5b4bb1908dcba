"""Untrusted checkpoints that unpack to more than their size are refused before they are unpacked."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.torch_archive import MOST_BYTES, MOST_PICKLE_BYTES, check_archive
from advpipe.pipeline.detector.second.family import SecondFamily

IMPORT = """
import sys
from pathlib import Path
import torch
from advpipe.pipeline.detector.second.family import SecondFamily
from advpipe.pipeline.core.errors import AdvpipeError
def peak_kib():  # that of `resource` is at least what the process that started this one held
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
before = peak_kib()
try:
    SecondFamily().import_weights(Path(sys.argv[1]))
except AdvpipeError as error:
    print(error)
peak_mib = (peak_kib() - before) >> 10
print(peak_mib < 200, peak_mib, "MiB")
"""


def imported(path: Path) -> str:
    """What importing comes to, and whether it took less than 200 MiB."""
    return subprocess.run(
        [sys.executable, "-c", IMPORT, path], capture_output=True, text=True, check=True
    ).stdout


def saved(path: Path, value: object) -> Path:
    torch.save(value, path)
    return path


def rewritten(path: Path, out: Path, method: int = zipfile.ZIP_STORED, **changed: bytes) -> Path:
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w", method) as new:
        for entry in old.infolist():
            content = changed.get(entry.filename.rpartition("/")[2].partition(".")[0], old.read(entry))
            new.writestr(entry.filename, content)
    return out


def test_files_of_torch_save_are_accepted(tmp_path: Path) -> None:
    state = {"a": torch.zeros(3), "b": torch.nn.Parameter(torch.ones(2, dtype=torch.float16))}
    optimiser = torch.optim.Adam([state["b"]]).state_dict()
    check_archive(saved(tmp_path / "a.pth", {"model_state": state, "optimizer_state": optimiser, "epoch": 1}))
    torch.save({"model_state": state}, tmp_path / "old.pth", _use_new_zipfile_serialization=False)
    check_archive(tmp_path / "old.pth")


def test_a_deflated_archive_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """300 MB of zeros in 300 kB."""
    whole = saved(tmp_path / "a.pth", {"model_state": {"a": torch.zeros(75_000_000)}})
    bomb = rewritten(whole, tmp_path / "bomb.pth", zipfile.ZIP_DEFLATED)
    assert bomb.stat().st_size < 500_000
    found = imported(bomb)
    assert "is compressed, unlike files of torch.save" in found
    assert "True" in found, found


def test_an_expanded_tensor_is_refused_before_it_is_expanded(tmp_path: Path) -> None:
    """A shape of 4 GB in four bytes, at the place of a weight."""
    whole = saved(tmp_path / "a.pth", {"model_state": their_names_expanded()})
    assert whole.stat().st_size < 100_000
    found = imported(whole)
    assert "its weights are too large" in found
    assert "True" in found, found


def their_names_expanded() -> dict[str, torch.Tensor]:
    from advpipe.pipeline.detector.common.openpcdet import their_names
    from advpipe.pipeline.detector.second.model import SecondNet
    from advpipe.pipeline.detector.second.presets import KITTI

    ours = [name for name, value in SecondNet(KITTI).state_dict().items() if value.is_floating_point()]
    number = torch.zeros(1)
    return {their: number.expand(1_000_000_000) for name in ours for their in their_names(name)}


class Long:
    """A pickle of it makes a bytearray of 1 GB, which torch lets through."""

    def __reduce__(self) -> tuple[type[bytearray], tuple[int]]:
        return bytearray, (1 << 30,)


@pytest.mark.parametrize("is_zip", [True, False], ids=["zip", "old"])
def test_a_pickle_that_builds_long_values_is_refused(tmp_path: Path, is_zip: bool) -> None:
    path = tmp_path / "a.pth"
    torch.save({"model_state": {"a": Long()}}, path, _use_new_zipfile_serialization=is_zip)
    found = imported(path)
    assert "holds __builtin__.bytearray" in found or "holds builtins.bytearray" in found
    assert "True" in found, found


def test_archives_that_torch_never_writes_are_refused(tmp_path: Path) -> None:
    good = saved(tmp_path / "a.pth", {"a": torch.zeros(1)})
    long = rewritten(good, tmp_path / "long.pth", data=b"N" * (MOST_PICKLE_BYTES + 1))
    with pytest.raises(AdvpipeError, match="bytes of names, too many"):
        check_archive(long)
    stacked = rewritten(good, tmp_path / "stacked.pth", data=b"\x80\x04\x8c\x02os\x8c\x06system\x93.")
    with pytest.raises(AdvpipeError, match="a computed name"):
        check_archive(stacked)
    many = tmp_path / "many.pth"
    with zipfile.ZipFile(many, "w") as archive:
        for number in range(10_001):
            archive.writestr(str(number), b"")
    with pytest.raises(AdvpipeError, match="an archive of 10001 entries"):
        check_archive(many)
    with zipfile.ZipFile(tmp_path / "twice.pth", "w") as archive:
        archive.writestr("a/data.pkl", b"N.")
        archive.writestr("A/DATA.PKL", b"N.")
    with pytest.raises(AdvpipeError, match="two entries with the same name"):
        check_archive(tmp_path / "twice.pth")


def test_an_archive_with_overlapping_entries_is_refused(tmp_path: Path) -> None:
    """The directory names one entry's bytes a hundred times."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        archive.writestr("a/data/0", bytes(100_000))
        for number in range(1, 100):
            archive.filelist.append(entry := zipfile.ZipInfo(f"a/data/{number}"))
            entry.header_offset, entry.CRC, entry.file_size, entry.compress_size = 0, 0, 100_000, 100_000
            archive.NameToInfo[entry.filename] = entry
    (tmp_path / "a.pth").write_bytes(whole.getvalue())
    with pytest.raises(AdvpipeError, match="declares more data than it holds"):
        check_archive(tmp_path / "a.pth")


def test_a_file_larger_than_any_checkpoint_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.pth").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    with pytest.raises(AdvpipeError, match="checkpoints of OpenPCDet have up to"):
        SecondFamily().import_weights(tmp_path / "a.pth")
