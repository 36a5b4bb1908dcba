"""OPV2V: what each agent says is what its vehicle says, mirrored; what is wrong is one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.carla import carla_from_se3
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.opv2v.form import Opv2vForm
from tests.stages.import_.importing import drive_frames, import_form
from tests.stages.import_.opv2v.tiny_opv2v import AGENTS, TICKS, document, points, write_opv2v, write_pcd


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_opv2v(tmp_path_factory.mktemp("train") / "2021_08_16_22_26_54")


def test_agents_are_vehicles_and_the_first_is_ego(scenario):
    frames = drive_frames("opv2v", scenario)
    assert [list(frame.vehicles) for frame in frames] == [["ego", "cav_1054", "rsu_1"]] * 3
    assert [frame.stamp_ns for frame in frames] == [3_400_000_000, 3_500_000_000, 3_600_000_000]
    assert (
        "Agents: 1045 is ego, 1054 is cav_1054, -1 is rsu_1."
        in Opv2vForm().open(scenario, ImportOptions()).notes
    )


@pytest.mark.parametrize("how", ["binary", "ascii"])
def test_points_change_the_sign_of_y_alone(tmp_path, how):
    write_opv2v(tmp_path / "s", how)
    for number, vehicle in enumerate(drive_frames("opv2v", tmp_path / "s")[0].vehicles.values()):
        table, cloud = points(number), vehicle.clouds["lidar"]
        tolerance = 0 if how == "binary" else 1e-7  # of the text
        assert np.allclose(cloud["x"], table[:, 0], rtol=tolerance, atol=0)
        assert np.allclose(cloud["y"], -table[:, 1], rtol=tolerance, atol=0)
        assert np.allclose(cloud["z"], table[:, 2], rtol=tolerance, atol=0)
        assert cloud["intensity"].tolist() == (table[:, 3] / np.float32(255)).tolist()


def test_boxes_are_right_handed(scenario):
    vehicle = drive_frames("opv2v", scenario)[1].vehicles["ego"]
    assert vehicle.boxes is not None
    assert vehicle.boxes_frame == "map"
    assert vehicle.boxes.ids == ("777", "cav_1054")
    assert [CLASSES[label] for label in vehicle.boxes.labels] == ["truck", "car"]
    assert vehicle.boxes.geometry[1, :6] == pytest.approx([21.0, -5.5, 0.74, 4.9, 2.12, 1.5], abs=1e-12)
    assert np.degrees(vehicle.boxes.geometry[1, 6]) == pytest.approx(-30)
    assert np.linalg.norm(vehicle.boxes.velocity_mps[1]) == pytest.approx(10)
    assert vehicle.lidar_points is not None


def test_the_lidar_s_pose_is_that_of_the_files(scenario, tmp_path):
    """Mount and pose together are `lidar_pose`, for the roadside unit too."""
    drive = Opv2vForm().open(scenario, ImportOptions())
    mounts = {child: pose for _, child, pose in drive.static_transforms}
    for tick, frame in zip(TICKS, drive.frames(), strict=True):
        for agent, (name, vehicle) in zip(AGENTS, frame.vehicles.items(), strict=True):
            assert vehicle.map_SE3_base is not None
            pose = carla_from_se3(vehicle.map_SE3_base @ mounts[f"{name}/lidar"])
            assert pose == pytest.approx(document(agent, int(tick))["lidar_pose"], abs=1e-9)
    assert np.allclose(mounts["rsu_1/lidar"], np.eye(4))


def test_each_vehicle_has_its_own_clouds_and_boxes_in_the_bag(scenario, tmp_path):
    summary = import_form("opv2v", scenario.parent, tmp_path / "d", interval_s=0.2)
    assert (summary.frames, summary.counts.clouds, summary.counts.objects) == (3, 9, 18)
    for number, name in enumerate(("ego", "cav_1054", "rsu_1")):
        frames = list(read_frames(summary.bag, lidar_topic=f"/{name}/lidar/points"))
        assert [frame.stamp_ns for frame in frames] == [0, 200_000_000, 400_000_000]
        assert frames[0].cloud["x"].tolist() == points(number)[:, 0].tolist()
        assert len(frames[0].boxes) == 2


def test_one_of_several_scenarios_is_chosen(scenario):
    write_opv2v(scenario.parent / "2021_08_18")
    with pytest.raises(UsageError, match=r"has 2 scenarios; choose one .*: 2021_08_16_22_26_54, 2021_08_18"):
        Opv2vForm().open(scenario.parent, ImportOptions())
    assert Opv2vForm().open(scenario.parent, ImportOptions(drive="2021_08_18")).name == "2021_08_18"


def spoil(agent: Path, name: str, text: str) -> None:
    (agent / name).write_text(text)


def with_document(agent: Path, **values) -> None:
    changed = {**document(agent.name, 70), **values}
    (agent / "000070.yaml").write_text(yaml.safe_dump(changed))


def with_points(agent: Path, table: np.ndarray) -> None:
    write_pcd(agent / "000070.pcd", table)


def truncate(agent: Path) -> None:
    file = agent / "000070.pcd"
    file.write_bytes(file.read_bytes()[:-5])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda agent: (agent / "000070.pcd").unlink(),
            "000070.pcd is missing, though 000070.yaml labels it",
        ),
        (
            lambda agent: (agent / "000070.yaml").unlink(),
            "000070.yaml is missing, though there is 000070.pcd",
        ),
        (lambda agent: [file.unlink() for file in agent.iterdir()], "holds no frame"),
        (truncate, "bytes of points are declared"),
        (lambda agent: spoil(agent, "000070.pcd", "ply\n"), "no line DATA in its header"),
        (
            lambda agent: spoil(
                agent, "000070.pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n"
            ),
            "fields",
        ),
        (lambda agent: with_points(agent, points(0)[:0]), "has no points"),
        (lambda agent: with_points(agent, points(0) * np.float32([1e3, 1e3, 1, 1])), "give metres"),
        (lambda agent: spoil(agent, "000070.yaml", "lidar_pose: [1, 2"), "not valid YAML"),
        (lambda agent: spoil(agent, "000070.yaml", "vehicles: {}"), "lidar_pose: Field required"),
        (lambda agent: with_document(agent, lidar_pose=[0.0, 1.0, 2.0]), "at least 6 items"),
        (
            lambda agent: with_document(agent, lidar_pose=[1e5, 0.0, 2.0, 0.0, 0.0, 0.0]),
            "the pose of ego jumps",
        ),
        (lambda agent: with_document(agent, vehicles={7: {"angle": [0, 0, 0]}}), "vehicles.7.location"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, damage, message):
    scenario = write_opv2v(tmp_path / "s")
    damage(scenario / "1045")
    with pytest.raises(AdvpipeError, match=message) as caught:
        import_form("opv2v", scenario, tmp_path / "d")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "d").exists()


def test_a_folder_of_another_form_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no scenario of OPV2V and holds none"):
        import_form("opv2v", tmp_path, tmp_path / "d")
