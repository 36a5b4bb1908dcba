"""What jobs read: found in what they are made of, recognised on another machine, replaced by a copy."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from advpipe.pipeline.cluster.inputs import Input, MissingInputsError, packed, unpacked
from advpipe.pipeline.core.remote_path import RemotePath, located


def work(bag: Path, detector: str, name: str) -> tuple[Path, str, str]:
    return bag, detector, name


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    folder = tmp_path / "drive" / "clean"
    folder.mkdir(parents=True)
    (folder / "clean_0.mcap").write_bytes(b"x" * 300_000)
    (folder / "metadata.yaml").write_text("rosbag2: 1\n")
    (folder / ".lock").touch()
    return folder


def test_paths_and_checkpoints_are_inputs_and_other_text_is_not(bag: Path, tmp_path: Path) -> None:
    checkpoint = tmp_path / "own.safetensors"
    checkpoint.write_bytes(b"weights")
    content, inputs = packed(partial(work, bag, str(checkpoint), str(bag)))
    assert [one.path for one in inputs] == [str(bag), str(checkpoint)]
    assert [file.name for file in inputs[0].files] == ["clean_0.mcap", "metadata.yaml"]
    assert inputs[0].size == 300_000 + 11
    assert unpacked(content, inputs, {})() == (bag, str(checkpoint), str(bag))


def test_a_path_that_does_not_exist_stays_as_it_is(tmp_path: Path) -> None:
    out = tmp_path / "new"
    content, inputs = packed(partial(work, out, "small", ""))
    assert not inputs
    assert unpacked(content, inputs, {})()[0] == out


def test_a_worker_that_does_not_see_an_input_takes_its_copy(bag: Path, tmp_path: Path) -> None:
    content, inputs = packed(partial(work, bag, "small", ""))
    moved = bag.rename(tmp_path / "copy")
    with pytest.raises(MissingInputsError) as raised:
        unpacked(content, inputs, {})
    assert raised.value.inputs == inputs
    assert unpacked(content, inputs, {str(bag): str(moved)})()[0] == moved


@pytest.mark.parametrize("place", [0, 299_999], ids=["begin", "end"])
def test_another_bag_at_the_same_path_is_not_the_input(bag: Path, place: int) -> None:
    content, inputs = packed(partial(work, bag, "small", ""))
    with (bag / "clean_0.mcap").open("r+b") as stream:
        stream.seek(place)
        stream.write(b"y")
    with pytest.raises(MissingInputsError):
        unpacked(content, inputs, {})


def test_a_file_is_an_input_too(bag: Path) -> None:
    one = Input.of(bag / "clean_0.mcap")
    assert [file.name for file in one.files] == [""]
    assert one.is_at(bag / "clean_0.mcap")
    assert not one.is_at(bag / "metadata.yaml")
    assert not one.is_at(bag / "none")


def test_a_path_in_an_object_store_is_read_there_by_every_node() -> None:
    far = located(Path("s3://drives/town/clean"))
    content, inputs = packed(partial(work, far, "small", ""))
    assert not inputs
    (found, *_) = unpacked(content, inputs, {})()
    assert isinstance(found, RemotePath)
    assert found == far
