"""nuScenes' development kit beside our import and export."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import CLASSES, box_corners
from advpipe.stages.export.recorded import recorded_frames
from advpipe.stages.export.run import export_bags
from tests.stages.export.drives import sample_data_set
from tests.stages.import_.importing import import_form
from tests.stages.import_.nuscenes.tiny_nuscenes import write_nuscenes

pytestmark = [pytest.mark.oracle, pytest.mark.usefixtures("stand_ins")]


def opened(version: str, folder: Path) -> Any:
    return pytest.importorskip("nuscenes.nuscenes").NuScenes(version, str(folder), verbose=False)


def samples_of(kit: Any, scene: str) -> list[dict]:
    (record,) = (each for each in kit.scene if each["name"] == scene)
    sample, found = kit.get("sample", record["first_sample_token"]), []
    while True:
        found.append(sample)
        if not sample["next"]:
            assert len(found) == record["nbr_samples"]
            return found
        sample = kit.get("sample", sample["next"])


def agree(kit: Any, scene: str, bag: Path) -> None:
    """The kit's points, poses, boxes and velocities are the bag's."""
    from nuscenes.utils.data_classes import LidarPointCloud
    from nuscenes.utils.geometry_utils import transform_matrix
    from pyquaternion import Quaternion

    samples = samples_of(kit, scene)
    frames = list(recorded_frames(bag, "/ego/lidar/points"))
    assert [sample["timestamp"] * 1000 for sample in samples] == [frame.stamp_ns for frame in frames]
    for sample, frame in zip(samples, frames, strict=True):
        data = kit.get("sample_data", sample["data"]["LIDAR_TOP"])
        path = kit.get_sample_data_path(data["token"])
        points = LidarPointCloud.from_file(path).points
        for row, name in enumerate(("x", "y", "z")):
            assert points[row].tolist() == frame.cloud[name].tolist()
        assert np.allclose(points[3] / 255, frame.cloud["intensity"], rtol=2e-7)
        for record, ours in (
            (kit.get("ego_pose", data["ego_pose_token"]), frame.map_SE3_base),
            (kit.get("calibrated_sensor", data["calibrated_sensor_token"]), frame.base_SE3_lidar),
        ):
            theirs = transform_matrix(record["translation"], Quaternion(record["rotation"]))
            assert np.allclose(theirs, ours, rtol=0, atol=1e-12)
        counted = {name: row for row, name in enumerate(frame.boxes.ids)}
        boxes = {box.token: box for box in kit.get_boxes(data["token"])}
        for token in sample["anns"]:
            annotation = kit.get("sample_annotation", token)
            row = counted.pop(annotation["instance_token"], None)
            if row is None:
                continue
            geometry = frame.boxes.geometry[row]
            corners = box_corners(geometry[None])[0]
            distances = np.linalg.norm(boxes[token].corners().T[:, None] - corners, axis=2)
            assert distances.min(axis=0).max() < 1e-9
            heading = boxes[token].orientation.rotate([1, 0, 0])[:2]
            assert heading == pytest.approx([np.cos(geometry[6]), np.sin(geometry[6])], abs=1e-9)
            velocity = kit.box_velocity(token)
            assert np.allclose(velocity, frame.boxes.velocity_mps[row], atol=1e-5, equal_nan=True)
        assert not counted


def test_it_agrees_with_an_import(tmp_path):
    source = write_nuscenes(tmp_path / "source")
    bag = import_form("nuscenes", source, tmp_path / "set", drive="scene-0103").bag
    agree(opened("v1.0-mini", source), "scene-0103", bag)


def test_it_opens_an_export_which_comes_back_the_same(tmp_path):
    """Ids are those of the kit's instances once they are imported; the kit's own rule gives velocities."""
    data_set = sample_data_set(tmp_path / "drive", "detach-x")
    exported = export_bags(data_set, "nuscenes", tmp_path / "out").folder
    for name in ("clean", "detach-x"):
        bag = import_form("nuscenes", exported / name, tmp_path / f"back-{name}").bag
        agree(opened("v1.0-trainval", exported / name), "drive", bag)


def test_its_benchmark_finds_the_exported_split(tmp_path):
    data_set = sample_data_set(tmp_path / "drive")
    exported = export_bags(data_set, "nuscenes", tmp_path / "out").folder
    kit = opened("v1.0-trainval", exported / "clean")
    from nuscenes.eval.common.loaders import get_samples_of_custom_split, load_gt_of_sample_tokens
    from nuscenes.eval.detection.data_classes import DetectionBox

    tokens = get_samples_of_custom_split("advpipe", kit)
    truth = load_gt_of_sample_tokens(kit, tokens, DetectionBox)
    names = {"car": "car", "truck": "truck", "bicycle": "cyclist", "pedestrian": "pedestrian"}
    for token, frame in zip(tokens, recorded_frames(data_set / "clean", "/ego/lidar/points"), strict=True):
        found = sorted(names[box.detection_name] for box in truth[token])
        assert found == sorted(CLASSES[label] for label in frame.boxes.labels)
