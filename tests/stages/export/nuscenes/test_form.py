"""What is exported as nuScenes is what the bag says, and comes back by an import."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.stages.export.form import ExportOptions
from advpipe.stages.export.recorded import recorded_frames
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from tests.stages.export.drives import sample_data_set, write_bag
from tests.stages.import_.importing import import_form
from tests.stages.import_.nuscenes.tiny_nuscenes import write_nuscenes

TOPIC = "/ego/lidar/points"


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_data_set(tmp_path_factory.mktemp("sets") / "drive", "detach-x")


@pytest.fixture(scope="module")
def exported(data_set: Path) -> Path:
    return export_bags(data_set, "nuscenes", data_set.with_name("out")).folder


def table(folder: Path, name: str) -> list[dict]:
    return json.loads((folder / "v1.0-trainval" / f"{name}.json").read_text())


def compare(a: Path, b: Path, velocity_mps: float) -> None:
    """Two bags say the same, but for what nuScenes cannot say: order, and velocities but by differences."""
    for one, two in zip(recorded_frames(a, TOPIC), recorded_frames(b, TOPIC), strict=True):
        assert one.stamp_ns == two.stamp_ns
        for name in ("x", "y", "z", "ring"):
            assert one.cloud[name].tobytes() == two.cloud[name].tobytes()
        assert np.allclose(one.cloud["intensity"], two.cloud["intensity"], rtol=1.2e-7, atol=0)  # * 255 / 255
        boxes, others = (frame.boxes[np.lexsort(frame.boxes.geometry.T[:6])] for frame in (one, two))
        assert np.array_equal(boxes.labels, others.labels)
        assert np.array_equal(boxes.geometry[:, :6], others.geometry[:, :6])
        assert np.allclose(boxes.velocity_mps, others.velocity_mps, rtol=0, atol=velocity_mps)
        turned = boxes.geometry[:, 6] - others.geometry[:, 6]
        assert np.abs(np.sin(turned / 2)).max() < 1e-15  # through quaternions
        assert np.allclose(one.map_SE3_base, two.map_SE3_base, rtol=0, atol=1e-14)
        assert np.allclose(one.base_SE3_lidar, two.base_SE3_lidar, rtol=0, atol=1e-14)


def test_a_simulated_drive_comes_back(data_set, exported, tmp_path):
    summary = import_form("nuscenes", exported / "clean", tmp_path / "back")
    assert summary.frames == 3
    compare(data_set / "clean", summary.bag, 1e9)


def test_a_tilted_real_drive_comes_back(tmp_path):
    """The mount turns by a quarter and the vehicle pitches; ignored objects keep their categories."""
    source = write_nuscenes(tmp_path / "source")
    first = import_form("nuscenes", source, tmp_path / "first", drive="scene-0061")
    exported = export_bags(tmp_path / "first", "nuscenes", tmp_path / "out").folder
    again = import_form("nuscenes", exported / "clean", tmp_path / "again")
    compare(first.bag, again.bag, 1e-9)
    for one, two in zip(read_frames(first.bag), read_frames(again.bag), strict=True):
        assert sorted(one.uncounted.boxes.class_names) == sorted(two.uncounted.boxes.class_names)


def test_samples_and_objects_have_the_same_tokens_in_all_bags(exported):
    for name in ("scene", "sample", "sample_data", "sample_annotation", "instance", "calibrated_sensor"):
        assert table(exported / "clean", name) == table(exported / "detach-x", name)
    assert table(exported / "clean", "scene")[0]["name"] == "drive"
    assert json.loads((exported / "clean/v1.0-trainval/splits.json").read_text()) == {"advpipe": ["drive"]}


def test_annotations_are_linked_in_time(exported):
    annotations = {each["token"]: each for each in table(exported / "clean", "sample_annotation")}
    stamps = {each["token"]: each["timestamp"] for each in table(exported / "clean", "sample")}
    for instance in table(exported / "clean", "instance"):
        chain = [annotations[instance["first_annotation_token"]]]
        while chain[-1]["next"]:
            assert annotations[chain[-1]["next"]]["prev"] == chain[-1]["token"]
            chain.append(annotations[chain[-1]["next"]])
        assert chain[0]["prev"] == ""
        assert chain[-1]["token"] == instance["last_annotation_token"]
        assert len(chain) == instance["nbr_annotations"]
        times = [stamps[each["sample_token"]] for each in chain]
        assert times == sorted(set(times))
    assert sum(each["nbr_annotations"] for each in table(exported / "clean", "instance")) == len(annotations)


def test_points_are_counted_in_the_boxes(data_set, exported):
    counts = [each["num_lidar_pts"] for each in table(exported / "clean", "sample_annotation")]
    frames = recorded_frames(data_set / "clean", TOPIC)
    assert sorted(counts) == sorted(int(n) for frame in frames for n in frame.lidar_points)
    assert max(counts) > 100


def test_a_bag_without_poses_has_the_vehicle_s_frame_for_a_map(tmp_path):
    cloud = np.zeros(50, POINT_DTYPE)
    cloud["x"] = np.linspace(1, 9, 50)
    box = np.array([[5.0, 0, 0, 4, 2, 2, 0.5]])
    boxes = Boxes(box, np.array([CLASSES.index("truck")]), ("",), np.full((1, 3), np.nan))
    bag = write_bag(
        tmp_path / "b", DriveFrame("a", 1_234_567, {"ego": VehicleFrame({"lidar": cloud}, boxes)})
    )
    summary = export_bags(bag, "nuscenes", tmp_path / "out")
    (annotation,) = table(tmp_path / "out" / "b", "sample_annotation")
    assert annotation["translation"] == [5, 0, 0]
    assert annotation["size"] == [2, 4, 2]
    assert annotation["num_lidar_pts"] > 0
    assert table(tmp_path / "out" / "b", "ego_pose")[0]["translation"] == [0, 0, 0]
    assert any("no poses" in note for note in summary.notes)
    assert "Stamps are cut to microseconds." in summary.notes


def test_chosen_frames_are_chosen_in_all_bags(data_set, tmp_path):
    out = export_bags(
        data_set, "nuscenes", tmp_path / "out", ExportOptions(frames=FrameSlice.parse("::2"))
    ).folder
    assert [len(table(out / name, "sample")) for name in ("clean", "detach-x")] == [2, 2]


def test_a_bag_without_the_chosen_frames_is_named(data_set, tmp_path):
    """An attack on the first frame alone, of which the export wants the last."""
    clean, short = tmp_path / "set" / "clean", tmp_path / "set" / "short"
    shutil.copytree(data_set / "clean", clean)
    frame = next(recorded_frames(clean, TOPIC))
    vehicle = VehicleFrame({"lidar": frame.cloud}, frame.boxes)
    write_bag(short, DriveFrame("a", frame.stamp_ns, {"ego": vehicle}))
    with pytest.raises(UsageError, match="short has none of the clean bag's chosen frames"):
        export_bags(
            tmp_path / "set", "nuscenes", tmp_path / "out", ExportOptions(frames=FrameSlice.parse("2:"))
        )


def test_a_bag_without_boxes_is_refused(tmp_path):
    cloud = np.zeros(5, POINT_DTYPE)
    frame = DriveFrame(
        "a", 1, {"ego": VehicleFrame({"lidar": cloud}, map_SE3_base=se3_from_yaw([0, 0, 0], 0))}
    )
    bag = write_bag(tmp_path / "b", frame)
    assert TOPIC in BagReader(bag).topics
    with pytest.raises(UsageError, match="has no ground truth"):
        export_bags(bag, "nuscenes", tmp_path / "out")
    assert not (tmp_path / "out").exists()
