import os
import re
from pathlib import Path

import pytest

from advpipe.pipeline.core.atomic_file import atomic_file, write_atomically, write_new
from advpipe.pipeline.core.errors import OutputExistsError
from advpipe.pipeline.core.leftover_names import is_leftover_name


def test_a_file_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"old")
    with atomic_file(path) as beside:
        beside.write_bytes(b"half")
        assert path.read_bytes() == b"old"
        assert is_leftover_name(beside.name)
        assert beside.stat().st_mode & 0o777 == 0o666 & ~_umask()
    assert path.read_bytes() == b"half"
    assert [each.name for each in tmp_path.iterdir()] == ["a.json"]


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"old")
    with pytest.raises(TypeError), atomic_file(path) as beside:
        beside.write_bytes("half")  # type: ignore[arg-type]
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_leftovers_of_killed_runs_are_removed_and_files_of_running_ones_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    (tmp_path / ".a.json.advpipe-partial-0123abcd").write_bytes(b"dead")
    (tmp_path / ".b.json.advpipe-partial-0123abcd").write_bytes(b"of another")
    with atomic_file(path) as living:
        living.write_bytes(b"1")
        write_atomically(path, b"2")
        assert living.exists()
    assert path.read_bytes() == b"1"
    assert {each.name for each in tmp_path.iterdir()} == {"a.json", ".b.json.advpipe-partial-0123abcd"}


def test_errors_name_the_final_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=re.escape(str(tmp_path / "no" / "a.json"))):
        write_atomically(tmp_path / "no" / "a.json", b"")


def test_a_new_text_is_written_atomically_and_never_replaces_a_file(tmp_path):
    path = tmp_path / "scenario.schema.json"
    write_new(path, "first\n")
    with pytest.raises(OutputExistsError):
        write_new(path, "second\n")
    assert path.read_text() == "first\n"
    write_new(path, "second\n", overwrite=True)
    assert path.read_text() == "second\n"
    assert [item.name for item in tmp_path.iterdir()] == [path.name]
