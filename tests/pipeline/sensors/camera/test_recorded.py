"""A recorded drive: images, calibration, boxes and LiDAR points agree with one another."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.geometry.transforms import invert, se3_from_quaternion, transform_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.camera.palette import PALETTE, TAG
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.simulate.run import simulate

SCENARIO = """
name: cameras
simulation: {duration_s: 0.2, warmup_s: 12, seed: 3, start: 2026-06-21T10:00:00Z}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 120, pedestrians: 40, parked_per_km: 150}
sensors:
  lidars:
    roof: {channels: 32, points_per_second: 288000, noise_stddev: 0}
    twin:
      {channels: 48, points_per_second: 960000, upper_fov: 3, lower_fov: -15, noise_stddev: 0, x_m: 0.6,
       z_m: 1.5}
  cameras:
    front:
      {preset: front, image_size_x: 480, images: [rgb, depth, semantic_segmentation, instance_segmentation]}
    rear: {preset: fisheye, image_size_x: 160, image_size_y: 120, yaw_deg: 180, sensor_tick: 0.2}
v2x: {enabled: false}
"""
LEAST_AGREEMENT = 0.99


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cameras")
    (folder / "cameras.yaml").write_text(SCENARIO, encoding="utf-8")
    simulate(load_scenario(str(folder / "cameras.yaml")), folder / "drive")
    return folder / "drive"


@pytest.fixture(scope="module")
def bag(dataset: Path) -> BagReader:
    return BagReader(dataset / "clean")


def messages(bag: BagReader, topic: str) -> list:
    return [message for _, message in bag.messages(topic)]


def image(bag: BagReader, topic: str, index: int = 0) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(messages(bag, topic)[index].data.tobytes())))


def optical_SE3_lidar(bag: BagReader, lidar: str) -> np.ndarray:
    poses = {}
    for message in messages(bag, "/tf_static"):
        for each in message.transforms:
            t, r = each.transform.translation, each.transform.rotation
            poses[each.child_frame_id] = se3_from_quaternion([r.x, r.y, r.z, r.w], [t.x, t.y, t.z])
    return invert(poses["ego/front_optical_frame"]) @ poses[f"ego/{lidar}"]


def lidar_pixels(bag: BagReader, lidar: str) -> tuple:
    """A frame, its points before the camera, and the pixels (N, 2) into which CameraInfo projects them."""
    (frame, *_) = read_frames(bag.path, lidar_topic=f"/ego/{lidar}/points")
    points = transform_points(optical_SE3_lidar(bag, lidar), xyz(frame.cloud))
    matrix = messages(bag, "/ego/front/camera_info")[0].k.reshape(3, 3)
    ahead = np.flatnonzero(points[:, 2] > 0.5)
    pixels = points[ahead] @ matrix.T
    pixels = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int)
    inside = (pixels >= 0).all(axis=1) & (pixels < (480, 360)).all(axis=1)
    return frame, ahead[inside], points[ahead[inside]], pixels[inside]


def away_from_edges(layer: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Whether all pixels around each pixel (N, 2) of a layer (H, W) are alike."""
    wide = np.pad(layer, 1, mode="edge")
    same = np.ones(layer.shape, bool)
    for y in range(3):
        for x in range(3):
            same &= wide[y : y + layer.shape[0], x : x + layer.shape[1]] == layer
    return same[pixels[:, 1], pixels[:, 0]]


def test_rates_formats_and_calibration(bag: BagReader) -> None:
    assert bag.topics["/ego/front/image/compressed"].count == 2
    assert bag.topics["/ego/rear/image/compressed"].count == 1
    formats = {
        kind: messages(bag, f"/ego/front/{kind}/compressed")[0].format
        for kind in ("image", "depth", "semantic_segmentation", "instance_segmentation")
    }
    assert formats == {
        "image": "rgb8; jpeg compressed bgr8",
        "depth": "16UC1; png compressed ",
        "semantic_segmentation": "rgb8; png compressed bgr8",
        "instance_segmentation": "rgb8; png compressed bgr8",
    }
    info = messages(bag, "/ego/front/camera_info")[0]
    assert (info.width, info.height, info.distortion_model, len(info.d)) == (480, 360, "plumb_bob", 5)
    assert info.k[0] == pytest.approx(240 / np.tan(np.deg2rad(35)))
    assert messages(bag, "/ego/rear/camera_info")[0].distortion_model == "equidistant"
    assert info.header.frame_id == "ego/front_optical_frame"
    assert image(bag, "/ego/front/image/compressed").shape == (360, 480, 3)


def test_lidar_points_lie_on_the_instance_of_their_pixel(bag: BagReader) -> None:
    """Of a LiDAR beside the camera: what one sees, the other sees, too."""
    frame, chosen, _, pixels = lidar_pixels(bag, "twin")
    red_green_blue = image(bag, "/ego/front/instance_segmentation/compressed").astype(int)
    ids = red_green_blue[..., 1] + 256 * red_green_blue[..., 2]
    (names, *_) = messages(bag, "/ego/ground_truth/front/instances")
    name_of = {each.class_id: each.class_name for each in names.class_map} | {0: ""}
    on = np.full(len(frame.cloud), "", object)
    inside = points_in_boxes(xyz(frame.cloud), frame.boxes.geometry, 0.15)
    for name, points in zip(frame.boxes.ids, inside, strict=True):
        above = xyz(frame.cloud)[points, 2] > -1.5 + 0.2  # not the road below it
        on[points[above]] = name
    clear = away_from_edges(ids, pixels)
    shown = np.array([name_of[each] for each in ids[pixels[:, 1], pixels[:, 0]]], object)
    seen = clear & ((shown != "") | (on[chosen] != ""))
    low = (shown != "") & (xyz(frame.cloud)[chosen, 2] < -1.5 + 0.2)  # tyres, where boxes hold road, too
    seen &= ~low
    assert seen.sum() > 500
    assert (shown == on[chosen])[seen].mean() >= LEAST_AGREEMENT
    away = clear & ~low
    assert (shown == on[chosen])[away].mean() >= LEAST_AGREEMENT


def test_lidar_ranges_are_the_depths_of_their_pixels(bag: BagReader) -> None:
    """Of a LiDAR on the roof, elsewhere than the camera."""
    _, _, points, pixels = lidar_pixels(bag, "roof")
    depth_m = image(bag, "/ego/front/depth/compressed")[pixels[:, 1], pixels[:, 0]] / 1000
    tags = image(bag, "/ego/front/instance_segmentation/compressed")[..., 0]
    clear = away_from_edges(tags, pixels) & (depth_m > 0) & (depth_m < 30)
    clear &= tags[pixels[:, 1], pixels[:, 0]] == TAG["Roads"]
    assert clear.sum() > 300
    assert np.mean(np.abs(depth_m - points[:, 2])[clear] < 0.03 * points[clear, 2] + 0.05) > 0.97


def test_semantics_have_the_colours_of_the_tags(bag: BagReader) -> None:
    colours = image(bag, "/ego/front/semantic_segmentation/compressed")
    tags = image(bag, "/ego/front/instance_segmentation/compressed")[..., 0]
    assert np.array_equal(colours, np.array(list(PALETTE.values()))[tags])
    present = {name for name in PALETTE if (tags == TAG[name]).any()}
    assert {"Roads", "RoadLine", "SideWalks", "Sky", "Car"} <= present
    assert {"Building", "Wall", "Vegetation"} & present  # what stands beside this street


def test_boxes_are_those_of_the_instances(bag: BagReader) -> None:
    red_green_blue = image(bag, "/ego/front/instance_segmentation/compressed").astype(int)
    ids = red_green_blue[..., 1] + 256 * red_green_blue[..., 2]
    (names, *_) = messages(bag, "/ego/ground_truth/front/instances")
    number = {each.class_name: each.class_id for each in names.class_map}
    visible, amodal = (
        messages(bag, f"/ego/ground_truth/front/{kind}_boxes")[0] for kind in ("visible", "amodal")
    )
    assert {each.id for each in visible.detections} == set(number) <= {each.id for each in amodal.detections}
    whole = {each.id: edges(each) for each in amodal.detections}
    for each in visible.detections:
        rows, columns = np.nonzero(ids == number[each.id])
        assert edges(each) == (columns.min(), rows.min(), columns.max(), rows.max())
        left, top, right, bottom = whole[each.id]
        assert left <= columns.min()
        assert top <= rows.min()
        assert right >= columns.max()
        assert bottom >= rows.max()
    labels = {each.id: each for each in messages(bag, "/ego/ground_truth/front/labels")[0].labels}
    for each in amodal.detections:
        label, share = labels[each.id], each.results[0].hypothesis.score
        hidden = 3 if share == 0 else int(1 - share >= 0.15) + int(1 - share >= 0.5)
        assert (label.occlusion, (label.left, label.top, label.right, label.bottom)) == (
            hidden,
            whole[each.id],
        )
    assert {label.occlusion for label in labels.values()} >= {0, 2}


def edges(detection) -> tuple[float, float, float, float]:
    box = detection.bbox
    x, y = box.center.position.x, box.center.position.y
    wide, high = (box.size_x - 1) / 2, (box.size_y - 1) / 2
    return x - wide, y - high, x + wide, y + high


def test_the_same_seed_gives_the_same_bytes(dataset: Path, tmp_path: Path) -> None:
    simulate(load_scenario(str(dataset.parent / "cameras.yaml")), tmp_path / "again")
    first, second = (folder / "clean" / "clean_0.mcap" for folder in (dataset, tmp_path / "again"))
    assert first.read_bytes() == second.read_bytes()


def test_viewers_show_the_images_with_their_calibration(dataset: Path) -> None:
    layout = json.loads((dataset / "clean" / "foxglove.json").read_text(encoding="utf-8"))
    panels = [each for name, each in layout["configById"].items() if name.startswith("Image!")]
    assert {
        "imageTopic": "/ego/front/image/compressed",
        "calibrationTopic": "/ego/front/camera_info",
    } in [each["imageMode"] for each in panels]
    assert not any("image" in topic for topic in layout["configById"]["3D!scene"]["topics"])


def test_a_picture_is_exposed_and_has_colours(bag: BagReader) -> None:
    picture = image(bag, "/ego/front/image/compressed").astype(float)
    assert 70 < picture.mean() < 180
    assert picture.std() > 25
    tags = image(bag, "/ego/front/instance_segmentation/compressed")[..., 0]
    sky, road, grass = (picture[tags == TAG[name]].mean(axis=0) for name in ("Sky", "Roads", "Terrain"))
    assert sky[2] > sky[0] + 8
    assert np.ptp(road) < 20
    assert grass[1] > grass[2] + 20


@pytest.mark.nightly
def test_kitti_levels_are_evaluated_in_the_own_camera(dataset: Path, tmp_path: Path) -> None:
    report = evaluate(
        dataset / "clean",
        [],
        tmp_path / "report",
        Options(bootstrap_draws=10, lidar_topic="/ego/roof/points"),
    )
    found = [each for each in report.rows if "map_clean" in each]
    assert found
    text = (tmp_path / "report" / "report.json").read_text(encoding="utf-8")
    assert '"difficulty": "easy"' in text
    assert '"difficulty": "hard"' in text
