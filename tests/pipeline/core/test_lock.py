import subprocess
import sys
import time
from pathlib import Path

import pytest

from advpipe.pipeline.core.lock import LOCK_NAME, is_locked, remove_folder, take_lock, take_stale_lock

HOLD = """
import os, sys
from pathlib import Path
from advpipe.pipeline.core.lock import take_lock
lock = take_lock(Path(sys.argv[1]))
if os.fork() == 0:
    os.read(0, 1)  # a worker that outlives its parent
    os._exit(0)
print("held", flush=True)
os.read(0, 1)
"""


def test_a_lock_is_exclusive_and_ends_with_its_process(tmp_path: Path) -> None:
    file = tmp_path / LOCK_NAME
    assert not is_locked(file)
    assert not file.exists()
    lock = take_lock(file)
    assert lock is not None
    assert is_locked(file)
    assert take_lock(file, patience_s=0) is None
    lock.close()
    assert not is_locked(file)
    with pytest.raises(NotADirectoryError):
        take_lock(file / "below")


def test_a_worker_of_a_killed_run_does_not_keep_its_lock(tmp_path: Path) -> None:
    file = tmp_path / LOCK_NAME
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(file)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        assert is_locked(file)
        time.sleep(0.2)  # the worker has begun
        process.kill()
        process.wait()
        lock = take_stale_lock(file)
        assert lock is not None
        lock.close()


def test_a_lock_in_a_removed_folder_is_not_taken(tmp_path: Path) -> None:
    assert take_lock(tmp_path / "gone" / LOCK_NAME) is None
    assert take_stale_lock(tmp_path / "gone" / LOCK_NAME) is None
    (tmp_path / LOCK_NAME).symlink_to(tmp_path / "elsewhere")
    assert take_stale_lock(tmp_path / LOCK_NAME) is None
    assert not (tmp_path / "elsewhere").exists()


def test_removing_a_folder_keeps_the_targets_of_its_links(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").touch()
    folder = tmp_path / "folder"
    (folder / "deep").mkdir(parents=True)
    (folder / "deep" / "link").symlink_to(tmp_path / "kept")
    (folder / "link").symlink_to(tmp_path / "kept")
    (folder / LOCK_NAME).touch()
    remove_folder(folder)
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert (tmp_path / "kept" / "file").exists()
