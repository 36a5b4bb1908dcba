"""Cameras of a stand-in server, which takes advpipe's own pictures: the same as in the embedded world."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.sensors.camera.palette import PALETTE, TAG
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.stages.simulate.world.carla.cameras import (
    DEPTH,
    INSTANCE,
    RGB,
    SEMANTIC,
    CarlaCamera,
    check_camera,
    seen_objects,
)

Sight = tuple[Path, Path, dict[str, Any]]


def pairs(sight: Sight, topic: str) -> list[tuple[Any, Any]]:
    """The messages of a topic through CARLA and in the embedded world."""
    found = [list(BagReader(bag).messages(topic)) for bag in sight[:2]]
    assert [stamp for stamp, _ in found[0]] == [stamp for stamp, _ in found[1]]
    return [(ours, embedded) for (_, ours), (_, embedded) in zip(*found, strict=True)]


def image(message: Any) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(bytes(message.data)))).astype(int)


def edges_of(detection: Any) -> np.ndarray:
    """Left, top, right and bottom of a 2D box."""
    middle, box = detection.bbox.center.position, detection.bbox
    half = np.array([box.size_x, box.size_y]) / 2
    return np.concatenate([(middle.x, middle.y) - half, (middle.x, middle.y) + half])


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("kind", "off"), [("image", 2), ("depth", 1), ("semantic_segmentation", 0), ("instance_segmentation", 0)]
)
def test_the_same_pixels(sight: Sight, kind: str, off: int) -> None:
    """Poses are in single precision on the way, which matters at few edges, but those of leaves, which JPEG
    spreads over blocks. Depth is in millimetres."""
    compared = pairs(sight, f"/ego/front/{kind}/compressed")
    tags = [image(one) for one, _ in pairs(sight, "/ego/front/semantic_segmentation/compressed")]
    assert len(compared) == 3
    for (ours, embedded), tag in zip(compared, tags, strict=True):
        assert ours.format == embedded.format
        assert ours.header == embedded.header
        agrees = np.abs(image(ours) - image(embedded)) <= off
        assert agrees.mean() > 0.996
        if kind == "image":
            agrees = agrees[~blocks_with((tag == PALETTE["Vegetation"]).all(axis=-1))]
        assert agrees.mean() > 0.998
        assert len(np.unique(image(ours))) > 4


def blocks_with(pixels: np.ndarray, side: int = 16) -> np.ndarray:
    """The pixels (H, W) of all blocks of a JPEG with colours of half resolution that contain one of these."""
    height, width = pixels.shape
    padded = np.pad(pixels, ((0, -height % side), (0, -width % side)))
    blocks = padded.reshape(padded.shape[0] // side, side, -1, side).any(axis=(1, 3))
    return blocks.repeat(side, 0).repeat(side, 1)[:height, :width]


@pytest.mark.oracle
def test_a_camera_sees_to_its_own_side_and_when_it_is_due(sight: Sight) -> None:
    compared = pairs(sight, "/ego/left/image/compressed")
    assert len(compared) == 2
    for ours, embedded in compared:
        assert np.corrcoef(image(ours).ravel(), image(embedded).ravel())[0, 1] > 0.9  # exposed otherwise


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["front", "left"])
def test_calibration_and_frames_are_the_same(sight: Sight, name: str) -> None:
    for topic in (f"/ego/{name}/camera_info", "/tf_static"):
        raw = [[one.cdr for one in BagReader(bag).raw_messages([topic])] for bag in sight[:2]]
        assert raw[0] == raw[1]
        assert raw[0]


@pytest.mark.oracle
def test_labels_are_those_of_the_embedded_world(sight: Sight) -> None:
    """What is seen is exact; what is hidden is estimated from 3D boxes."""
    seen = 0
    for ours, embedded in pairs(sight, "/ego/ground_truth/front/visible_boxes"):
        edges = [{one.id: one.bbox for one in message.detections} for message in (ours, embedded)]
        assert edges[0] == edges[1]
        shares = [
            {one.id: one.results[0].hypothesis.score for one in message.detections}
            for message in (ours, embedded)
        ]
        off = [abs(shares[0][name] - shares[1][name]) for name in shares[0]]
        assert np.mean(off) < 0.1
        seen += len(edges[0])
    assert seen > 15
    for ours, embedded in pairs(sight, "/ego/ground_truth/front/amodal_boxes"):
        whole = {one.id: one for one in ours.detections}
        known = {one.id for one in embedded.detections}
        assert known <= whole.keys()
        further = whole.keys() - known  # no pixel would show them, but one passes their 3D boxes
        assert all(whole[name].results[0].hypothesis.score == 0 for name in further)
        clear = [one for one in embedded.detections if one.results[0].hypothesis.score > 0.999]
        apart_px = np.array([np.abs(edges_of(whole[one.id]) - edges_of(one)).max() for one in clear])
        assert apart_px.max() <= 3  # where something passes before a corner of the 3D box
        assert (apart_px == 0).mean() > 0.7
    for ours, embedded in pairs(sight, "/ego/ground_truth/front/labels"):
        by_id = {one.id: one for one in ours.labels}
        for one in embedded.labels:
            assert by_id[one.id].class_id == one.class_id
            assert by_id[one.id].truncation == pytest.approx(one.truncation, abs=1e-5)
            assert by_id[one.id].observation_angle == pytest.approx(one.observation_angle, abs=1e-5)
    for ours, embedded in pairs(sight, "/ego/ground_truth/front/instances"):
        assert ours.class_map == embedded.class_map


@pytest.mark.oracle
def test_a_camera_without_images_of_its_truth_has_labels(sight: Sight) -> None:
    assert pairs(sight, "/ego/ground_truth/left/labels")


@pytest.mark.oracle
def test_the_scenarios_values_arrive_in_carla(sight: Sight) -> None:
    sensors = [(entry[1], entry[2]) for entry in sight[2]["history"] if entry[0] == "sensor"]
    left = next(values for blueprint, values in sensors if blueprint == RGB and values["iso"] == "200.0")
    expected = {"image_size_x": 96, "image_size_y": 64, "fov": 90, "shutter_speed": 500}
    expected |= {"exposure_compensation": 0.5, "motion_blur_intensity": 0.25, "lens_k": 0, "sensor_tick": 0}
    assert {key: float(left[key]) for key in expected} == pytest.approx(expected)
    assert {blueprint for blueprint, _ in sensors} >= {RGB, DEPTH, SEMANTIC, INSTANCE}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"preset": "fisheye"}, r"sensors\.cameras\.c\.projection: CARLA has no fisheye cameras"),
        ({"distortion": [0.1]}, r"sensors\.cameras\.c\.distortion: .* leave distortion out"),
        ({"preset": "kitti"}, r"sensors\.cameras\.c\.intrinsics: .* give fov instead"),
    ],
)
def test_what_carla_lacks_is_refused(keys: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        check_camera("sensors.cameras.c", CameraSensor.model_validate(keys))


def test_what_has_no_effect_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    check_camera("sensors.cameras.c", CameraSensor())
    assert capsys.readouterr().err == ""
    check_camera("sensors.cameras.c", CameraSensor(samples=4))
    assert "sensors.cameras.c.samples has no effect" in capsys.readouterr().err


def test_centred_intrinsics_are_a_field_of_view() -> None:
    keys = {"image_size_x": 200, "image_size_y": 100}
    middle = {"fx": 100.0, "fy": 100.0, "cx": 99.5, "cy": 49.5}
    section = CameraSensor.model_validate({**keys, "intrinsics": middle})
    check_camera("sensors.cameras.c", section)
    assert CarlaCamera(section, 0.1).attributes[DEPTH]["fov"] == pytest.approx(90.0)


class Image:
    """A `carla.Image` of one colour."""

    def __init__(self, width: int, height: int, red: int, green: int, blue: int) -> None:
        self.width, self.height = width, height
        self.raw_data = bytes([blue, green, red, 255]) * (width * height)


def test_depth_is_decoded_and_another_size_refused() -> None:
    """The number of 24 bits counts from 0 to 1000 m along the axis; the last one is the sky."""
    camera = CarlaCamera(CameraSensor(image_size_x=9, image_size_y=8), 0.1)
    pixels = np.frombuffer(Image(9, 8, 0x11, 0x22, 0x03).raw_data, np.uint8).reshape(-1, 4)
    middle = camera.range_m(pixels)[4 * 9 + 4]
    depth_m = (0x11 + 0x22 * 256 + 0x03 * 65536) / (256**3 - 1) * 1000
    assert middle == pytest.approx(depth_m * np.hypot(1, 0.5 / 4.5), rel=1e-6)
    assert np.isinf(camera.range_m(np.full((72, 4), 255, np.uint8))).all()
    data = {DEPTH: Image(9, 8, 0, 0, 0), INSTANCE: Image(8, 9, 0, 0, 0)}
    with pytest.raises(AdvpipeError, match="sends 8 x 9 pixels, not 9 x 8"):
        camera.picture(data, Boxes(), np.zeros(0, np.int64), np.eye(4))


def test_only_road_users_have_numbers_of_actors() -> None:
    """Of an actor's number, 16 bits arrive; a wall may have any number of Unreal's."""
    actors = np.array([7, 0x1_0203])
    pixels = np.array(
        [
            [0, 7, TAG["Car"], 255],
            [2, 3, TAG["Rider"], 255],
            [0, 7, TAG["Wall"], 255],
            [0, 8, TAG["Car"], 255],
        ]
    )
    assert seen_objects(pixels.astype(np.uint8), actors).tolist() == [0, 1, -1, -1]
