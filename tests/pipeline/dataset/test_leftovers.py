import hashlib
import os
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.lock import LOCK_NAME, take_lock
from advpipe.pipeline.core.partial import MOVING_NAME, REPLACED_NAME, PartialFolder
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.dataset.layout import read_layout
from advpipe.pipeline.dataset.leftovers import find_leftovers, find_scratch, recognise, refuse_inside


def killed(folder: Path, *names: str) -> Path:
    """A folder as a killed run leaves it."""
    for name in (LOCK_NAME, *names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"x" * 10)
    return folder


NOT_OURS = {
    "no lock": ".a.partial-mybackup/notes",
    "another number of letters": ".a.partial-x1/.lock",
    "capitals": ".a.partial-ABCDEFGH/.lock",
    "no hash": ".a.nohexdigits0.job/.lock",
    "a job without a lock": ".a.0123456789ab.job/000000.npz",
    "not hidden": "a.partial-abcdefgh/.lock",
    "another program's file": ".a.partial",
    "in a hidden folder": ".git/.a.partial-abcdefgh/.lock",
    "a file for a folder": ".a.partial-abcdefgh",
    "a folder for a file": ".a.advpipe-partial-01234567/.lock",
}


@pytest.mark.parametrize("name", NOT_OURS)
def test_what_is_not_ours_is_not_found(tmp_path: Path, name: str) -> None:
    file = tmp_path / NOT_OURS[name]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    assert not list(find_leftovers(tmp_path))


def test_links_are_not_followed(tmp_path: Path) -> None:
    killed(tmp_path / "elsewhere" / ".a.partial-abcdefgh", "b")
    root = tmp_path / "root"
    root.mkdir()
    (root / "link").symlink_to(tmp_path / "elsewhere")
    (root / ".a.partial-abcdefgh").symlink_to(tmp_path / "elsewhere" / ".a.partial-abcdefgh")
    (root / ".b.advpipe-partial-01234567").symlink_to(tmp_path / "elsewhere")
    assert not list(find_leftovers(root))


def test_what_each_is_good_for(tmp_path: Path) -> None:
    killed(tmp_path / "d" / ".adv.0123456789ab.job", "000000.npz", "000002.npz", "000003.77.partial")
    killed(tmp_path / "d" / ".none.0123456789ab.job")
    request = b"attack: detach\n"
    digest = hashlib.sha256(request).hexdigest()[:12]
    killed(tmp_path / "d" / f".made.{digest}.job", "000000.npz")
    (tmp_path / "d" / "made").mkdir()
    (tmp_path / "d" / "made" / "attack.yaml").write_bytes(request)
    killed(tmp_path / "d" / "reports" / ".small.partial-abcdefgh", "report.json")
    killed(tmp_path / ".old.partial-abcdefgh", f"{REPLACED_NAME}/report.json")
    killed(tmp_path / ".whole.partial-abcdefgh", MOVING_NAME, "report.json")
    (tmp_path / ".x.json.advpipe-partial-01234567").write_bytes(b"{")
    found = {left.path.relative_to(tmp_path).as_posix(): left for left in find_leftovers(tmp_path)}
    assert {name: left.use for name, left in found.items()} == {
        ".old.partial-abcdefgh": "restore",
        ".whole.partial-abcdefgh": "resume",
        ".x.json.advpipe-partial-01234567": None,
        "d/.adv.0123456789ab.job": "resume",
        "d/.none.0123456789ab.job": None,
        f"d/.made.{digest}.job": None,
        "d/reports/.small.partial-abcdefgh": None,
    }
    job = found["d/.adv.0123456789ab.job"]
    assert (job.final, job.frames, job.size_bytes) == (tmp_path / "d" / "adv", 2, 40)


def test_a_living_runs_folder_stays(tmp_path: Path) -> None:
    partial = PartialFolder(tmp_path / "out")
    (found,) = find_leftovers(tmp_path)
    assert found.is_running
    assert not found.remove()
    assert partial.path.is_dir()
    partial._lock.close()  # as the kernel does when a process is killed
    (found,) = find_leftovers(tmp_path)
    assert not found.is_running
    assert found.remove()
    assert not list(tmp_path.iterdir())
    assert not found.remove()


def test_parts_of_an_import_are_of_use_until_the_drive_is_there(tmp_path: Path) -> None:
    """A run that replaces an older drive can still go on from its parts."""
    job = killed(
        tmp_path / ".d.0123456789ab.job", "00000000-00000020/part.json", "00000020-00000033/part.json"
    )
    source = tmp_path / "d" / "source.yaml"
    source.parent.mkdir()
    uses = []
    for written_s in (None, 1000, 3000):
        if written_s is not None:
            source.touch()
            os.utime(source, (written_s, written_s))
        for part in job.glob("0*"):
            os.utime(part, (2000, 2000))
        leftover = recognise(job)
        assert leftover is not None
        uses.append((leftover.frames, leftover.use))
    assert uses == [(33, "resume"), (33, "resume"), (33, None)]


def test_a_run_that_began_meanwhile_keeps_its_job(tmp_path: Path) -> None:
    job = killed(tmp_path / ".adv.0123456789ab.job")
    (found,) = find_leftovers(tmp_path)
    assert not found.is_running
    lock = take_lock(job / LOCK_NAME)
    assert not found.remove()
    assert job.is_dir()
    assert lock is not None
    lock.close()


def test_removing_follows_no_link(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "a").touch()
    folder = killed(tmp_path / ".a.partial-abcdefgh")
    (folder / "link").symlink_to(tmp_path / "kept")
    found = recognise(folder)
    assert found is not None
    assert found.remove()
    assert (tmp_path / "kept" / "a").exists()


def test_a_path_inside_a_leftover_is_refused(tmp_path: Path) -> None:
    killed(tmp_path / ".town.partial-abcdefgh", "clean/.clean.partial-abcdefgh/x")
    with pytest.raises(AdvpipeError, match="give that folder"):
        refuse_inside(tmp_path / ".town.partial-abcdefgh" / "clean")


def test_temporary_files_of_killed_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    killed(tmp_path / "advpipe-abcdefgh", "files/x")
    (tmp_path / "advpipe-mynotes1").mkdir()
    with scratch_folder() as folder:
        found = {left.path.name: left.is_running for left in find_scratch()}
        assert found == {"advpipe-abcdefgh": False, folder.parent.name: True}
        assert not any(left.remove() for left in find_scratch() if left.is_running)
        assert folder.is_dir()
    assert [left.remove() for left in find_scratch()] == [True]
    assert [path.name for path in tmp_path.iterdir()] == ["advpipe-mynotes1"]


def test_many_folders_are_walked_and_deep_ones_left(tmp_path: Path) -> None:
    for number in range(300):
        (tmp_path / f"{number:03d}" / "a").mkdir(parents=True)
    killed(tmp_path / "299" / "a" / ".x.partial-abcdefgh")
    (tmp_path / "0").joinpath(*"d" * 200).mkdir(parents=True)
    assert [left.path.parent.parent.name for left in find_leftovers(tmp_path)] == ["299"]


def test_a_data_set_lists_its_leftovers_and_refuses_a_living_run(tmp_path: Path) -> None:
    (tmp_path / "clean").mkdir()
    (tmp_path / "clean" / "metadata.yaml").touch()
    report = killed(tmp_path / "reports" / ".small.partial-abcdefgh", "report.json")
    layout = read_layout(tmp_path)
    assert layout.reports == ()
    assert [left.path for left in layout.leftovers] == [report]
    layout.refuse_running()
    lock = take_lock(report / LOCK_NAME)
    with pytest.raises(AdvpipeError, match="locked by a run"):
        read_layout(tmp_path).refuse_running()
    assert lock is not None
    lock.close()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_folders_that_cannot_be_read_have_none(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir(mode=0)
    killed(tmp_path / ".x.partial-abcdefgh")
    assert len(list(find_leftovers(tmp_path))) == 1
