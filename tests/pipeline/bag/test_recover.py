"""What a cut leaves is saved, byte for byte; the oracles are rosbags' and the MCAP library's readers."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recover import recover
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.core.partial import PartialFolder
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import schema_text, serialise

EGO = VehicleTopics()
STEP_NS = 100_000_000
POINTS = 60_000  # each cloud is over 1 MiB, so each ends a chunk
Record = Callable[..., Path]


def write_drive(bag: BagWriter, frames: int) -> None:
    """The truth comes after its cloud, so in the next chunk."""
    boxes = Boxes(np.array([[5.0, 1, 0, 4, 2, 1.5, 0]]), np.array([0]), ("a",), np.zeros((1, 3)))
    for frame in range(frames):
        stamp_ns = frame * STEP_NS
        cloud = np.zeros(POINTS, POINT_DTYPE)
        cloud["x"] = np.random.default_rng(frame).normal(size=POINTS)
        bag.write(topics.CLOCK, build.clock(stamp_ns), stamp_ns)
        bag.write_cdr(EGO.lidar_points, cloud_to_cdr(cloud, stamp_ns, EGO.lidar_frame), stamp_ns)
        bag.write(EGO.objects, build.detections_message(stamp_ns, EGO.lidar_frame, boxes), stamp_ns)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    provenance = clean_provenance("town", "name: town\n", 7, "0" * 64)
    with BagWriter(tmp_path / "drive", provenance=provenance) as bag:
        write_drive(bag, 6)
    return tmp_path / "drive"


def cut(drive: Path, share: float, to: Path) -> Path:
    whole = (drive / "drive_0.mcap").read_bytes()
    to.write_bytes(whole[: int(len(whole) * share)])
    return to


def read_everywhere(bag: Path) -> int:
    """Messages that both oracles read, with all checksums right."""
    validated = describe(bag).checksums
    assert validated.chunks == validated.chunks_covered
    with AnyReader([bag]) as reader:
        count = 0
        for connection, _, cdr in reader.messages():
            reader.deserialize(cdr, connection.msgtype)
            count += 1
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == count
    return count


@pytest.mark.oracle
@pytest.mark.parametrize(("share", "clouds"), [(0.3, 1), (0.5, 2), (0.99, 4)])
def test_a_cut_file(drive: Path, tmp_path: Path, share: float, clouds: int) -> None:
    """Six chunks: k whole ones hold k clouds, and the truth of all of them but the last.

    A single one holds no truth at all: then the cloud is all there is, and is kept.
    """
    file = cut(drive, share, tmp_path / "cut.mcap")
    recovery = recover(file)
    assert recovery.out == tmp_path / "cut-recovered"
    assert recovery.clouds == clouds
    assert recovery.clouds_without_truth == (clouds > 1)
    assert 0 < recovery.lost_bytes < file.stat().st_size
    assert read_everywhere(recovery.out) == recovery.messages
    saved, original = BagReader(recovery.out), BagReader(drive)
    everything = list(original.raw_messages())
    assert all(raw in everything for raw in saved.raw_messages())
    before, after = list(read_frames(drive)), list(read_frames(recovery.out))
    assert [frame.cloud.tobytes() for frame in after] == [frame.cloud.tobytes() for frame in before[:clouds]]
    stated = dict(saved.provenance)
    assert json.loads(stated.pop("recovered"))["clouds"] == clouds
    assert stated == original.provenance


def test_only_the_index_is_missing(drive: Path, tmp_path: Path) -> None:
    whole = (drive / "drive_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[:-20])
    recovery = recover(tmp_path / "cut.mcap")
    assert (recovery.clouds, recovery.lost_bytes, recovery.lost_chunks) == (6, 0, 0)
    assert list(BagReader(tmp_path / "cut-recovered").raw_messages()) == list(BagReader(drive).raw_messages())


def test_a_folder_without_its_metadata(drive: Path) -> None:
    (drive / "metadata.yaml").unlink()
    assert recover(drive, drive.with_name("new")).messages == 18
    assert read_everywhere(drive.with_name("new")) == 18


@pytest.mark.parametrize("chunk", [0, 2])
def test_a_damaged_chunk_is_left_out_and_counted(drive: Path, chunk: int) -> None:
    """Also the first, which alone defines the topics: the summary repeats them."""
    path = drive / "drive_0.mcap"
    with path.open("rb") as stream:
        index = make_reader(stream).get_summary().chunk_indexes[chunk]
    changed = bytearray(path.read_bytes())
    changed[index.chunk_start_offset + index.chunk_length // 2] ^= 4
    path.write_bytes(changed)
    recovery = recover(drive)
    assert recovery.lost_chunks == 1
    assert recovery.lost_messages == (2 if chunk == 0 else 3)  # the cloud and the clock, and older truth
    assert recovery.lost_bytes == index.compressed_size
    assert recovery.clouds + recovery.clouds_without_truth == 5
    assert recovery.clouds_without_truth == (0 if chunk == 0 else 1)  # the one before, whose truth was in it
    assert len(list(read_frames(drive.with_name("drive-recovered")))) == recovery.clouds


def test_behind_a_damaged_record_it_goes_on(drive: Path) -> None:
    path = drive / "drive_0.mcap"
    with path.open("rb") as stream:
        start = make_reader(stream).get_summary().chunk_indexes[3].chunk_start_offset
    changed = bytearray(path.read_bytes())
    changed[start + 8] = 0xFF  # the record's length
    path.write_bytes(changed)
    recovery = recover(drive)
    assert recovery.clouds + recovery.clouds_without_truth == 5


@pytest.mark.parametrize("as_file", [True, False])
def test_an_intact_bag_is_left_alone(drive: Path, as_file: bool) -> None:
    recovery = recover(drive / "drive_0.mcap" if as_file else drive)
    assert recovery.out is None
    assert str(recovery).endswith("intact, with 18 messages; nothing to recover")
    assert [path.name for path in drive.parent.iterdir()] == ["drive"]


def test_another_tools_bag(tmp_path: Path, record_foreign: Record) -> None:
    """No checksums, truth logged later than its cloud: all that is there is kept."""
    bag = record_foreign(tmp_path / "foreign")
    (path,) = bag.glob("*.mcap")
    path.write_bytes(path.read_bytes()[:-30])
    recovery = recover(path, tmp_path / "out")
    assert (recovery.messages, recovery.clouds) == (9, 3)
    assert len(list(read_frames(tmp_path / "out"))) == 3


def test_several_files_and_records_of_others(tmp_path: Path) -> None:
    folder = tmp_path / "long"
    folder.mkdir()
    name = "rosgraph_msgs/msg/Clock"
    for part, stamp_ns in (("2", 5), ("10", 9)):
        with (folder / f"long_{part}.mcap").open("wb") as stream:
            writer = Writer(stream, use_chunking=part == "10")
            writer.start("ros2")
            writer.add_metadata("notes", {"who": part})
            schema = writer.register_schema(name, "ros2msg", schema_text(name).encode())
            channel = writer.register_channel("/clock", "cdr", schema)
            writer.add_message(channel, stamp_ns, serialise(build.clock(stamp_ns), name), stamp_ns)
            writer.finish()
    (folder / "long_11.mcap").touch()  # made, and not filled
    recover(folder)
    (file,) = (tmp_path / "long-recovered").glob("*.mcap")
    assert [raw.log_time_ns for raw in BagReader(file).raw_messages()] == [5, 9]
    with file.open("rb") as stream:
        assert {"notes", "rosbag2", "advpipe"} == {item.name for item in make_reader(stream).iter_metadata()}


def refused(path: Path) -> str:
    with pytest.raises(AdvpipeError) as caught:
        recover(path)
    assert not list(path.parent.glob("*recovered*"))
    return str(caught.value)


def test_nothing_to_save(tmp_path: Path, drive: Path) -> None:
    assert "holds no .mcap file, and no killed run" in refused(tmp_path / "nothing")
    (tmp_path / "folder").mkdir()
    assert "holds no .mcap file" in refused(tmp_path / "folder")
    (tmp_path / "empty.mcap").touch()
    assert "is empty" in refused(tmp_path / "empty.mcap")
    (tmp_path / "noise.mcap").write_bytes(np.random.default_rng(0).bytes(5000))
    assert "is not an MCAP file" in refused(tmp_path / "noise.mcap")
    assert "no complete chunk" in refused(cut(drive, 0.1, tmp_path / "early.mcap"))


def test_no_ros_recording(tmp_path: Path) -> None:
    with (tmp_path / "json.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("")
        channel = writer.register_channel("/t", "json", writer.register_schema("t", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    assert "/t is encoded as 'json'" in refused(tmp_path / "json.mcap")


def test_an_output_stays_unless_overwrite(drive: Path, tmp_path: Path) -> None:
    file = cut(drive, 0.5, tmp_path / "cut.mcap")
    recover(file)
    with pytest.raises(OutputExistsError, match="overwrite=True"):
        recover(file)
    recover(file, overwrite=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter").touch()
    with pytest.raises(AdvpipeError, match="not replaced"):
        recover(file, tmp_path / "mine", overwrite=True)


@pytest.mark.parametrize("share", [0.03, 0.2, 0.4, 0.7, 0.95])
def test_any_damage_is_saved_around_or_refused(drive: Path, tmp_path: Path, share: float) -> None:
    """Bits flipped anywhere: what is saved is what was written."""
    expected = list(BagReader(drive).raw_messages())
    whole = (drive / "drive_0.mcap").read_bytes()
    rng = np.random.default_rng(int(share * 100))
    for number in range(6):
        changed = bytearray(whole[: int(len(whole) * rng.uniform(share, 1))])
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
        (tmp_path / "bad.mcap").write_bytes(changed)
        try:
            out = recover(tmp_path / "bad.mcap", tmp_path / f"out{number}").out
        except AdvpipeError:
            continue
        assert out is None or all(raw in expected for raw in BagReader(out).raw_messages())


KILLED = """
import os, signal, sys
from pathlib import Path
from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.partial import FolderKind, staged_folder
sys.path.insert(0, sys.argv[2])
from test_recover import write_drive
kind = FolderKind("data set", ("scenario.yaml", "clean"), ("scenario.yaml", "clean/metadata.yaml"))
with staged_folder(Path(sys.argv[1]), True, kind) as folder:
    (folder / "scenario.yaml").write_text("name: town\\n")
    with BagWriter(folder / "clean", provenance=clean_provenance("town", "", 7, "")) as bag:
        write_drive(bag, 12)
        os.kill(os.getpid(), signal.SIGKILL)
"""


def run_killed(path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(path), str(Path(__file__).parent)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL


@pytest.mark.oracle
def test_a_killed_run(tmp_path: Path) -> None:
    """Its data set is found by the name it was to get, and stays until a later run has finished."""
    town = tmp_path / "town"
    run_killed(town)
    (leftover,) = tmp_path.iterdir()
    recovery = recover(town)
    assert recovery.clouds >= 4  # 12, but for the one being filled and those that waited
    assert {path.name for path in (tmp_path / "town-recovered").iterdir()} == {"scenario.yaml", "clean"}
    assert read_everywhere(tmp_path / "town-recovered" / "clean") == recovery.messages
    assert len(list(read_frames(tmp_path / "town-recovered" / "clean"))) == recovery.clouds
    again = recover(leftover, tmp_path / "again")
    assert again.messages == recovery.messages
    with pytest.raises(ZeroDivisionError), BagWriter(town, provenance={}):
        raise ZeroDivisionError
    assert leftover.is_dir()  # the next run failed
    run_killed(town)
    assert leftover.is_dir()  # two are kept for the time being ...
    run_killed(town)
    assert not leftover.is_dir()  # ... the oldest goes
    with BagWriter(town, provenance={}):
        pass
    assert {path.name for path in tmp_path.iterdir()} == {"town", "town-recovered", "again"}


def test_a_living_run_is_not_disturbed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_drive(bag, 2)
        with pytest.raises(AdvpipeError, match="is still being written"):
            recover(tmp_path / "bag")
    assert BagReader(tmp_path / "bag").topics[EGO.lidar_points.name].count == 2


def test_while_recovering_no_run_removes_the_source(drive: Path, tmp_path: Path) -> None:
    dead = PartialFolder(tmp_path / "town")
    dead._lock.close()  # as the kernel does when a process is killed
    shutil.copy(drive / "drive_0.mcap", dead.path / "town_0.mcap")
    from advpipe.pipeline.bag.partial_recording import find_partial_recording

    with find_partial_recording(tmp_path / "town"):
        PartialFolder(tmp_path / "town").commit(lambda _: False)
        assert dead.path.is_dir()
    os.rmdir(tmp_path / "town")
    PartialFolder(tmp_path / "town").commit(lambda _: False)
    assert not dead.path.exists()
