"""Bags in an object store: read in place, and uploaded by `share`. The store is moto's server."""

from __future__ import annotations

import logging
import os
import pickle
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from pyarrow.fs import S3FileSystem

import advpipe
from advpipe.commands.paths import output_beside
from advpipe.pipeline.bag.locate import adversarial_bags, resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.remote_path import RemotePath, located, store_of
from advpipe.pipeline.dataset.upload import upload
from advpipe.stages.export.form import ExportOptions
from advpipe.stages.export.run import export_bags
from advpipe.stages.share.run import share
from advpipe.stages.verify.run import verify

if os.environ.get("CI"):
    pass
else:
    pytest.importorskip("moto.server")


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """The name of an empty bucket."""
    import moto.server

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = moto.server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    keys = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    with pytest.MonkeyPatch.context() as patch:
        for key, value in keys.items():
            patch.setenv(key, value)
        store_of.cache_clear()
        maker = S3FileSystem(endpoint_override=keys["AWS_ENDPOINT_URL"], allow_bucket_creation=True)
        maker.create_dir("drives")
        yield "drives"
    store_of.cache_clear()
    server.stop()


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped drive with a forged GPS."""
    from advpipe.pipeline.dataset.sample import copy_sample
    from advpipe.pipeline.scenario.attacks import attack_spec
    from advpipe.stages.attack.request import AttackRequest
    from advpipe.stages.attack.run import attack

    folder = copy_sample(tmp_path_factory.mktemp("drives") / "sample").parent
    request = AttackRequest((attack_spec({"type": "gnss-jump"}),), seed=1)
    attack(folder / "clean", folder / "jump", request)
    return folder


@pytest.fixture(scope="module")
def uploaded(bucket: str, dataset: Path) -> Path:
    target = Path(f"s3://{bucket}/drive")
    summary = share(dataset, target)
    assert summary.made == (located(target),)
    return target


def raw(bag: Path) -> list[tuple[str, int, bytes]]:
    return [(one.topic.name, one.log_time_ns, bytes(one.cdr)) for one in BagReader(bag).raw_messages()]


def test_a_shared_drive_is_read_where_it_lies(dataset: Path, uploaded: Path) -> None:
    bag = resolve_bag(uploaded)
    assert str(bag) == "s3://drives/drive/clean"
    assert raw(bag) == raw(dataset / "clean")
    (jump,) = adversarial_bags(bag.parent)
    assert jump.name == "jump"
    assert raw(jump) == raw(dataset / "jump")


def test_an_upload_is_a_data_set_that_verify_finds_good(uploaded: Path, tmp_path: Path) -> None:
    remote = located(uploaded)
    assert isinstance(remote, RemotePath)
    for name in remote._names(recursive=True):
        path = remote.joinpath(*name.split("/")[len(remote.parts) - 1 :])
        if path.is_file():
            copied = tmp_path.joinpath(*path.parts[3:])
            copied.parent.mkdir(parents=True, exist_ok=True)
            copied.write_bytes(path.read_bytes())
    assert verify(tmp_path).is_good


def test_an_upload_replaces_another_only_if_told(dataset: Path, uploaded: Path) -> None:
    remote = located(uploaded)
    assert isinstance(remote, RemotePath)
    files = {"SHA256SUMS": dataset / "SHA256SUMS"}
    with pytest.raises(OutputExistsError, match="s3://drives/drive"):
        upload(files, remote)


def test_paths_are_those_of_pathlib(uploaded: Path) -> None:
    bag = resolve_bag(uploaded)
    assert bag.parent / "clean" == bag
    assert bag.name == "clean"
    assert pickle.loads(pickle.dumps(bag)) == bag
    assert isinstance(bag / "metadata.yaml", RemotePath)
    assert (bag / "metadata.yaml").read_text(encoding="utf-8").startswith("rosbag2_bagfile_information")
    assert (bag / "metadata.yaml").stat().st_size == len((bag / "metadata.yaml").read_bytes())
    assert sorted(path.name for path in bag.glob("*.mcap")) == ["clean_0.mcap"]
    assert [path.name for path in bag.parent.glob("*/*.mcap")] == ["clean_0.mcap", "jump_0.mcap"]


def test_nothing_is_written_beside_it(uploaded: Path) -> None:
    with pytest.raises(OSError, match="only read here"):
        (resolve_bag(uploaded) / "new").mkdir()
    with pytest.raises(OSError, match="only read here"):
        (resolve_bag(uploaded) / "new").open("wb")


@pytest.mark.parametrize("name", ["s3://drives/nothing", "s3://elsewhere/drive"])
def test_what_is_not_there_is_one_line(bucket: str, name: str) -> None:
    with pytest.raises(UsageError, match=f"{name} does not exist"):
        resolve_bag(Path(name))


def test_verify_reads_a_store(dataset: Path, uploaded: Path, bucket: str) -> None:
    """A data set, a bag and a file; what was changed there is found."""
    result = verify(uploaded)
    assert result.is_good
    assert result.path == "s3://drives/drive"
    assert verify(uploaded / "jump").is_good
    assert verify(uploaded / "clean" / "clean_0.mcap", quick=True).is_good
    assert not [*Path(tempfile.gettempdir()).glob("advpipe-*/files/drive")]
    broken = share(dataset, Path(f"s3://{bucket}/broken")).made[0]
    assert isinstance(broken, RemotePath)
    with broken.store.open_output_stream((broken / "scenario.yaml").key) as stream:
        stream.write(b"name: other")
    (finding, *_) = verify(Path(f"s3://{bucket}/broken"), quick=True).findings
    assert "scenario.yaml" in str(finding)
    with pytest.raises(UsageError, match=r"^s3://drives/nothing does not exist"):
        verify(Path(f"s3://{bucket}/nothing"))


def test_share_copies_from_a_store_and_within_it(uploaded: Path, bucket: str, tmp_path: Path) -> None:
    share(uploaded, tmp_path / "shared")
    assert verify(tmp_path / "shared").is_good
    again = Path(f"s3://{bucket}/again")
    share(uploaded, again)
    assert verify(again).is_good
    with pytest.raises(UsageError, match="is inside the data set s3://drives/drive; choose another output"):
        share(uploaded, uploaded / "inside")


def test_a_disk_without_room_is_one_line(uploaded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 0, 10))
    with pytest.raises(AdvpipeError, match=r"^s3://drives/drive: \d+ bytes are needed in \S+, 10 are free"):
        verify(uploaded)


def test_a_drive_is_evaluated_where_it_lies(dataset: Path, uploaded: Path, tmp_path: Path) -> None:
    rows = [
        advpipe.evaluate(drive, drive / "jump", scene=False, out=tmp_path / name).to_dicts()
        for name, drive in (("near", dataset), ("far", located(uploaded)))
    ]
    assert rows[0] == rows[1]
    names = [sorted(path.name for path in (tmp_path / name).iterdir()) for name in ("near", "far")]
    assert names[0] == names[1]


def test_a_drive_is_exported_from_where_it_lies(dataset: Path, uploaded: Path, tmp_path: Path) -> None:
    options = ExportOptions(frames=FrameSlice.parse(":1"))
    for name, drive in (("near", dataset), ("far", located(uploaded))):
        export_bags(drive, "pcd", tmp_path / name, options)
    near, far = (
        {path.relative_to(tmp_path / name): path for path in (tmp_path / name).rglob("*") if path.is_file()}
        for name in ("near", "far")
    )
    clouds = [path for path in near if path.suffix == ".pcd"]
    assert clouds
    assert near.keys() == far.keys()
    assert all(near[path].read_bytes() == far[path].read_bytes() for path in clouds)


def test_what_is_made_of_it_lies_on_this_machine(uploaded: Path, tmp_path: Path) -> None:
    remote = located(uploaded)
    assert output_beside(remote, "drive-kitti").parts[-2:] == ("datasets", "drive-kitti")
    assert output_beside(tmp_path / "drive", "drive-kitti") == tmp_path / "drive-kitti"
    with pytest.raises(UsageError, match="name a folder of this machine with --out"):
        output_beside(remote, "drive-kitti", Path("s3://drives/drive-kitti"))
