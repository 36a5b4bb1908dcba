"""Files that the system does not give: findings of `verify`, one line of `share`, and never a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.dataset import checksums
from advpipe.stages.verify.run import verify

VERIFY = """
import sys
from pathlib import Path
from advpipe.stages.verify.run import verify
root = Path(sys.argv[1])
for name in sys.argv[2:]:
    (root / name).chmod(0)
    for quick in (True, False):
        for finding in verify(root, quick=quick).findings:
            print(name, finding, sep="|")
    (root / name).chmod(0o755)
"""
NAMES = ("clean/clean_0.mcap", "clean/metadata.yaml", "detach/labels.parquet", "gnss", "scenario.yaml")


def as_a_user(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Root reads everything: it gives that right away first."""
    mighty = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
    return subprocess.run([*mighty, sys.executable, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("is_listed", [True, False])
def test_verify_names_the_unreadable_file(data_set: Path, is_listed: bool) -> None:
    if is_listed:
        checksums.write(data_set)
    done = as_a_user("-c", VERIFY, data_set, *NAMES)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    for name in NAMES:
        own = [line for line in lines if line.startswith(f"{name}|")]
        assert any("Permission denied" in line for line in own), (name, lines)
        assert len(own) < 20, own


def test_share_refuses_an_unreadable_file_in_one_line(data_set: Path, tmp_path: Path) -> None:
    path = data_set / "detach" / "labels.parquet"
    path.chmod(0)
    code = "from advpipe.pipeline.cli import app; app()"
    done = as_a_user("-c", code, "share", data_set, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == f"advpipe: {path}: cannot be read: Permission denied"
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_folders_in_place_of_files_are_faults(data_set: Path) -> None:
    from advpipe.stages.verify.run import verify

    for name in ("clean/clean_0.mcap", "detach/labels.parquet", "cam/attack.yaml", "scenario.yaml"):
        path = data_set / name
        path.rename(data_set / "elsewhere")
        path.mkdir()
        found = verify(data_set).findings
        assert any(name.split("/")[0] in finding.where for finding in found), (name, found)
        path.rmdir()
        (data_set / "elsewhere").rename(path)
    assert verify(data_set, quick=True).is_good


def test_a_recording_of_another_format_is_named_with_what_to_do(tmp_path: Path) -> None:
    bag = tmp_path / "drive.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(UsageError, match=r"drive\.bag is a ROS 1 bag; `advpipe import rosbag "):
        verify(bag)
