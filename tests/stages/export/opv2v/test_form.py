"""What is exported as OPV2V is what the bag says, and comes back by an import."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.stages.export.opv2v.ids import Numbers
from advpipe.stages.export.opv2v.ticks import Ticks
from advpipe.stages.export.recorded import recorded_frames
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from tests.stages.export.drives import sample_data_set, write_bag
from tests.stages.import_.importing import import_form
from tests.stages.import_.opv2v.tiny_opv2v import AGENTS, TICKS, document, write_opv2v

TOPIC = "/ego/lidar/points"


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_data_set(tmp_path_factory.mktemp("sets") / "drive", "detach-x")


@pytest.fixture(scope="module")
def exported(data_set: Path) -> Path:
    return export_bags(data_set, "opv2v", data_set.with_name("out")).folder


def test_a_simulated_drive_comes_back(data_set, exported, tmp_path):
    bag = import_form("opv2v", exported / "clean", tmp_path / "back").bag
    clean = list(recorded_frames(data_set / "clean", TOPIC))
    for one, two in zip(clean, recorded_frames(bag, TOPIC), strict=True):
        assert one.stamp_ns - clean[0].stamp_ns == two.stamp_ns
        for name in ("x", "y", "z"):
            assert one.cloud[name].tobytes() == two.cloud[name].tobytes()
        assert np.abs(one.cloud["intensity"] - two.cloud["intensity"]).max() <= 0.5001 / 255
        ids = json.loads((exported / "clean" / "drive" / "ids.json").read_text())
        names = [ids[name] for name in two.boxes.ids]
        vehicles = one.boxes[one.boxes.labels != CLASSES.index("pedestrian")]
        assert 20 < len(vehicles) == len(two.boxes) < len(one.boxes)
        back = two.boxes[np.array([names.index(name) for name in vehicles.ids])]
        assert np.array_equal(vehicles.labels, back.labels)
        assert np.allclose(vehicles.geometry, back.geometry, rtol=0, atol=1e-12)
        assert np.allclose(one.map_SE3_lidar, two.map_SE3_lidar, rtol=0, atol=1e-12)


def test_an_imported_scenario_comes_back(tmp_path):
    imported = import_form("opv2v", write_opv2v(tmp_path / "source"), tmp_path / "set")
    out = export_bags(tmp_path / "set", "opv2v", tmp_path / "out").folder / "clean" / "set"
    assert imported.counts.clouds == 9
    assert sorted(path.name for path in out.iterdir() if path.is_dir()) == ["-1", "0", "1054"]
    for agent, number in zip(AGENTS, ("0", "1054", "-1"), strict=True):
        for tick in TICKS:
            written = yaml.safe_load((out / number / f"{tick}.yaml").read_text())
            expected = document(agent, int(tick))
            assert written["lidar_pose"] == pytest.approx(expected["lidar_pose"], abs=1e-9)
            truck = written["vehicles"][777]
            assert truck["extent"] == pytest.approx(expected["vehicles"][777]["extent"])
            assert truck["speed"] == pytest.approx(36)
            # of the box's centre; what an upright box cannot say is left out
            assert truck["location"][:2] == pytest.approx(expected["vehicles"][777]["location"][:2])
            assert truck["angle"] == pytest.approx([0, 30, 0], abs=1e-9)
        assert (1054 in written["vehicles"], 0 in written["vehicles"]) == ((number == "0"), (number != "0"))


def test_agents_and_objects_have_the_same_numbers_in_all_bags(exported):
    files = sorted(path.relative_to(exported / "clean") for path in (exported / "clean").rglob("*.*"))
    assert len(files) == 7  # three clouds, three annotations, ids.json
    for file in files:
        assert (exported / "clean" / file).read_bytes() == (exported / "detach-x" / file).read_bytes()


def test_open3d_reads_clouds_as_opencood_does(data_set, exported):
    import open3d

    frame = next(recorded_frames(data_set / "clean", TOPIC))
    cloud = open3d.io.read_point_cloud(str(exported / "clean" / "drive" / "0" / "000000.pcd"))
    points = np.asarray(cloud.points)
    assert (
        points.astype(np.float32).tolist()
        == np.column_stack([frame.cloud["x"], -frame.cloud["y"], frame.cloud["z"]]).tolist()
    )
    assert np.abs(np.asarray(cloud.colors)[:, 0] - frame.cloud["intensity"]).max() <= 0.5001 / 255


def test_numbers_are_those_of_the_source_where_it_has_any():
    numbers = Numbers(["ego", "cav_650", "rsu_1", "bus"])
    assert [numbers.of(name) for name in ("ego", "cav_650", "rsu_1", "bus")] == [0, 650, -1, 1_000_000]
    assert [numbers.of(name) for name in ("7", "650", "car.3", "0", "car.3")] == [
        7,
        1_000_001,
        1_000_002,
        1_000_003,
        1_000_002,
    ]
    assert len(numbers.names()) == 8


def test_ticks_are_50_ms():
    ticks = Ticks()
    for stamp_ns in (10**18, 10**18 + 100_000_000, 10**18 + 170_000_000):
        ticks.add(stamp_ns)
    assert [ticks.name(10**18), ticks.name(10**18 + 100_000_000)] == ["000000", "000002"]
    assert ticks.notes == {"Stamps are rounded to OPV2V's ticks of 50 ms."}
    with pytest.raises(AdvpipeError, match="two clouds lie in one tick"):
        ticks.add(10**18 + 171_000_000)


def test_poses_are_needed(tmp_path):
    cloud = np.zeros(5, POINT_DTYPE)
    bag = write_bag(tmp_path / "b", DriveFrame("a", 1, {"ego": VehicleFrame({"lidar": cloud}, Boxes())}))
    with pytest.raises(AdvpipeError, match="no transform says where"):
        export_bags(bag, "opv2v", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_vehicles_out_of_step_are_named(tmp_path):
    cloud, pose = np.zeros(5, POINT_DTYPE), se3_from_yaw([0, 0, 0], 0)
    ego, late = (
        VehicleFrame(
            {"lidar": cloud},
            Boxes(),
            "map",
            map_SE3_base=pose,
            transforms=[(f"{name}/base_link", f"{name}/lidar", pose)],
        )
        for name in ("ego", "cav_1")
    )
    bag = write_bag(tmp_path / "b", DriveFrame("a", 1, {"ego": ego}), DriveFrame("b", 10**8, {"cav_1": late}))
    with pytest.raises(AdvpipeError, match="no cloud of /cav_1/lidar/points has the stamp of a chosen one"):
        export_bags(bag, "opv2v", tmp_path / "out")
