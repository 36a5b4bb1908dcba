import shutil
from pathlib import Path

import pytest

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.partial import PartialFolder


def never(path: Path) -> bool:
    return False


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    folder = PartialFolder(tmp_path / "new" / "out")
    (folder.path / "a").write_text("1")
    assert not (tmp_path / "new" / "out").exists()
    folder.commit(never)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["out"]
    assert [path.name for path in (tmp_path / "new" / "out").iterdir()] == ["a"]


def test_a_folder_that_is_filled_is_not_removed_by_the_next_run(tmp_path: Path) -> None:
    living = PartialFolder(tmp_path / "o[u]t")
    dead = PartialFolder(tmp_path / "o[u]t")
    dead._lock.close()  # as the kernel does when a process is killed
    other = PartialFolder(tmp_path / "out")
    PartialFolder(tmp_path / "o[u]t").commit(never)
    assert living.path.is_dir()
    assert not dead.path.exists()
    assert other.path.is_dir()


def test_what_is_there_stays_unless_it_may_be_replaced(tmp_path: Path) -> None:
    final = tmp_path / "out"
    final.mkdir()
    (final / "old").touch()
    folder = PartialFolder(final)
    (folder.path / "new").touch()
    with pytest.raises(AdvpipeError, match="not overwriting"):
        folder.commit(never)
    folder.discard()
    assert [path.name for path in final.iterdir()] == ["old"]
    folder = PartialFolder(final)
    (folder.path / "new").touch()
    folder.commit(lambda path: path == final)
    assert [path.name for path in final.iterdir()] == ["new"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_others_may_read_it(tmp_path: Path) -> None:
    folder = PartialFolder(tmp_path / "out")
    folder.commit(never)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755
    shutil.rmtree(tmp_path / "out")
