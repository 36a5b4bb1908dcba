"""Imports that are killed go on after their last part; a damaged part and a changed source are read anew."""

from __future__ import annotations

import json
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from forked import Done, Forks
from what_is_left import cleaned, copied, files, hidden

NIGHTLY = pytest.mark.nightly
IMPORT = ["import", "files", "many", "--out", "i"]


@pytest.fixture(scope="module")
def many(forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Done, dict[str, str]]:
    """A folder of 45 clouds, which are three parts of an import, and an import that nobody disturbs."""
    folder = tmp_path_factory.mktemp("many")
    (folder / "many").mkdir()
    rng = np.random.default_rng(0)
    for k in range(45):
        table = rng.uniform((-40, -40, -2, 0), (40, 40, 0, 2), (100, 4))  # too bright, which is noticed
        table.astype("<f4").tofile(folder / "many" / f"{k}.bin")
    whole = copied(folder, folder.parent / "whole")
    done = forks.run(whole, *IMPORT, "--json")
    assert done.code == 0, done.error
    return folder, done, files(whole)


@pytest.mark.parametrize(
    "by",
    [
        signal.SIGKILL,
        *(pytest.param(by, marks=pytest.mark.nightly) for by in (signal.SIGTERM, signal.SIGINT)),
    ],
)
def test_an_import_goes_on_after_its_last_part(
    forks: Forks, tmp_path: Path, many: tuple[Path, Done, dict[str, str]], by: int
) -> None:
    """Stopped just before each part, and the data set, gets its name: same bytes, same words in the end."""
    folder, done, expected = many
    renames = [place for place, name in enumerate(done.moments) if name == "os.rename"]
    assert len(renames) == 5  # three parts, the bag, the data set
    for parts, moment in enumerate(renames):
        work = copied(folder, tmp_path / "work")
        stopped = forks.run(work, *IMPORT, kill_at=moment, by=by)
        assert stopped.code in (-by, 128 + by), stopped.error
        assert not (work / "i").exists()
        jobs = [found for found in cleaned(forks, work) if found["kind"] == "job"]
        resumable = [(found["use"], found["frames"]) for found in jobs if found["frames"]]
        assert resumable == ([("resume", min(20 * parts, 45))] if parts else [])
        again = forks.run(work, *IMPORT, "--json")
        assert again.code == 0, again.error
        assert json.loads(again.out) == json.loads(done.out)
        assert "--scale-intensity" in again.out
        assert files(work) == expected
        assert not hidden(work)


def test_a_part_that_a_power_failure_damaged_is_read_again(
    forks: Forks, tmp_path: Path, many: tuple[Path, Done, dict[str, str]]
) -> None:
    folder, done, expected = many
    last = [place for place, name in enumerate(done.moments) if name == "os.rename"][-1]
    for damage in ("part.json", "*.mcap", "data"):
        work = copied(folder, tmp_path / "work")
        forks.run(work, *IMPORT, kill_at=last)
        (part,) = work.glob(".i.*.job/00000020-*")
        if damage == "data":
            file = next(part.glob("*.mcap"))
            data = bytearray(file.read_bytes())
            data[len(data) // 2] ^= 255
            file.write_bytes(data)
            refused = forks.run(work, *IMPORT)
            assert refused.code == 1
            assert "run the same import again" in refused.error
        else:
            next(part.glob(damage)).write_bytes(b"")
        again = forks.run(work, *IMPORT)
        assert again.code == 0, (damage, again.error)
        assert files(work) == expected


def test_a_source_that_changed_is_read_anew(
    forks: Forks, tmp_path: Path, many: tuple[Path, Done, dict[str, str]]
) -> None:
    folder, done, _ = many
    work = copied(folder, tmp_path / "work")
    last = [place for place, name in enumerate(done.moments) if name == "os.rename"][-1]
    forks.run(work, *IMPORT, kill_at=last)
    (work / "many" / "0.bin").unlink()
    shutil.copy(work / "many" / "1.bin", work / "many" / "0.bin")
    assert forks.run(work, *IMPORT).code == 0
    shutil.copytree(work / "many", tmp_path / "fresh" / "many")
    assert forks.run(tmp_path / "fresh", *IMPORT).code == 0
    assert files(work) == files(tmp_path / "fresh")
