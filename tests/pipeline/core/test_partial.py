import itertools
import shutil
from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.partial import FolderKind, PartialFolder, staged_folder

KIND = FolderKind("thing", ("data", "info"), ("data/mark",))


def never(path: Path) -> bool:
    return False


def test_a_folder_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    folder = PartialFolder(tmp_path / "new" / "out")
    (folder.path / "a").write_text("1")
    assert not (tmp_path / "new" / "out").exists()
    folder.commit(never)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["out"]
    assert [path.name for path in (tmp_path / "new" / "out").iterdir()] == ["a"]


def test_a_folder_in_use_is_not_removed_by_another_run(tmp_path: Path) -> None:
    living = PartialFolder(tmp_path / "o[u]t")
    dead = PartialFolder(tmp_path / "o[u]t")
    dead._lock.close()  # as the kernel does when a process is killed
    other = PartialFolder(tmp_path / "out")
    PartialFolder(tmp_path / "o[u]t").commit(never)
    assert living.path.is_dir()
    assert not dead.path.exists()
    assert other.path.is_dir()


def test_an_existing_folder_is_kept_unless_it_may_be_replaced(tmp_path: Path) -> None:
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


def test_the_folder_is_readable_by_other_users(tmp_path: Path) -> None:
    folder = PartialFolder(tmp_path / "out")
    folder.commit(never)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755
    shutil.rmtree(tmp_path / "out")


def test_parents_made_for_a_discarded_folder_are_removed(tmp_path: Path) -> None:
    PartialFolder(tmp_path / "a" / "b" / "out").discard()
    assert not list(tmp_path.iterdir())
    first, second = PartialFolder(tmp_path / "a" / "one"), PartialFolder(tmp_path / "a" / "two")
    first.discard()
    assert second.path.is_dir()
    with pytest.raises(OSError, match="too long"):
        PartialFolder(tmp_path / "c" / ("x" * 250))
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def fill(final: Path, value: str) -> None:
    with staged_folder(final, True, KIND) as folder:
        (folder / "data").mkdir()
        (folder / "data" / "mark").write_text(value)
        (folder / "info").write_text(value)


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_items_that_are_not_made_anew_are_kept(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("keep")
    for value in ("1", "2"):
        fill(tmp_path / "out", value)
        assert contents(tmp_path) == {"out/mine": "keep", "out/info": value, "out/data/mark": value}


@pytest.mark.parametrize("name", ["info", "data/mine"])
def test_foreign_items_are_not_replaced(tmp_path: Path, name: str) -> None:
    (tmp_path / "out" / name).parent.mkdir(parents=True)
    (tmp_path / "out" / name).write_text("keep")
    with pytest.raises(AdvpipeError, match=r"but no data/mark, so it is not a thing; it is not replaced"):
        fill(tmp_path / "out", "1")
    assert contents(tmp_path) == {f"out/{name}": "keep"}


def test_a_folder_that_another_run_makes_meanwhile_is_kept(tmp_path: Path) -> None:
    staged = staged_folder(tmp_path / "out", False, KIND)
    (staged.__enter__() / "info").write_text("new")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "info").write_text("keep")
    with pytest.raises(AdvpipeError, match="already exists"):
        staged.__exit__(None, None, None)
    assert contents(tmp_path) == {"out/info": "keep"}


@pytest.mark.parametrize("interrupted_at", range(1, 5))
def test_an_interrupted_replacement_leaves_the_old_items(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interrupted_at: int
) -> None:
    fill(tmp_path / "out", "old")
    rename, calls = Path.rename, itertools.count(1)

    def interrupted(path: Path, target: Path) -> Path:
        if next(calls) == interrupted_at:
            raise KeyboardInterrupt
        return rename(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", interrupted)
        with pytest.raises(KeyboardInterrupt):
            fill(tmp_path / "out", "new")
    assert contents(tmp_path) == {"out/info": "old", "out/data/mark": "old"}


def test_an_interrupted_commit_leaves_the_old_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    final = tmp_path / "out"
    final.mkdir()
    (final / "old").touch()
    folder = PartialFolder(final)
    rename = Path.rename

    def interrupted(path: Path, target: Path) -> Path:
        if path == folder.path:
            raise KeyboardInterrupt
        return rename(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", interrupted)
        with pytest.raises(KeyboardInterrupt):
            folder.commit(lambda _: True)
    folder.discard()
    assert [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")] == ["out", "out/old"]
