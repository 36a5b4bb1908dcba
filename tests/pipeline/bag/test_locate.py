import os
from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.locate import adversarial_bags, bag_named, newest_dataset, resolve_bag
from advpipe.pipeline.core.errors import AdvpipeError

Record = Callable[..., Path]


def test_three_ways_to_name_a_bag(tmp_path: Path, record: Record) -> None:
    clean = record(tmp_path / "town" / "clean", frames=1)
    assert resolve_bag(tmp_path / "town") == clean
    assert resolve_bag(clean) == clean
    assert resolve_bag(clean / "clean_0.mcap") == clean / "clean_0.mcap"


def test_where_one_stands(tmp_path: Path, record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    """`.` and `..` have a name, too, which something can lie beside."""
    record(tmp_path / "drive" / "clean", frames=1)
    monkeypatch.chdir(tmp_path / "drive")
    assert resolve_bag(Path()) == tmp_path / "drive" / "clean"
    monkeypatch.chdir("clean")
    assert resolve_bag(Path()) == tmp_path / "drive" / "clean"
    assert resolve_bag(Path("..")) == tmp_path / "drive" / "clean"
    assert bag_named(Path("../clean")) == Path("../clean")


def test_no_bag(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="does not exist"):
        resolve_bag(tmp_path / "nothing")
    with pytest.raises(AdvpipeError, match="is not a bag"):
        resolve_bag(tmp_path)


def test_the_newest_dataset(tmp_path: Path, record: Record) -> None:
    with pytest.raises(AdvpipeError, match="advpipe simulate"):
        newest_dataset(tmp_path / "datasets")
    for name, age in (("b", 2), ("a", 3), (".hidden", 9)):
        bag = record(tmp_path / "datasets" / name / "clean", frames=1)
        os.utime(bag / "metadata.yaml", (age, age))
    assert newest_dataset(tmp_path / "datasets").name == "a"


def test_adversarial_bags(tmp_path: Path, record: Record) -> None:
    for name in ("clean", "detach-2", "detach-1", ".detach-3.partial-x"):
        record(tmp_path / name, frames=1)
    (tmp_path / "reports").mkdir()
    assert [bag.name for bag in adversarial_bags(tmp_path)] == ["detach-1", "detach-2"]
