"""What the viewer of a report tells of objects is what the tables of the report count."""

import base64
import json
import re
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from place_drive import DETECTOR, hide_first_car

from advpipe.commands.evaluate import evaluate
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.markers import lane_markers
from advpipe.pipeline.messages.topics import LANES, MAP_FRAME, TF, TF_STATIC, VehicleTopics


def scenes_of(folder):
    found = re.findall(
        r'<script type="application/json" class="adv-scene"[^>]*>(.*?)</script>',
        (folder / "report.html").read_text(),
    )
    return [json.loads(text) for text in found]


@pytest.fixture(scope="module")
def report(clean, attacked_once, tmp_path_factory):
    out = tmp_path_factory.mktemp("reports") / "report"
    bag = attacked_once(hide_first_car, frames=range(6))
    evaluate(clean, bag, out=out, detector=DETECTOR, baseline=False, workers=1)
    return out


def test_outcomes_are_those_of_the_tables(report):
    scenes = scenes_of(report)
    table = pq.read_table(str(report / "results.parquet")).to_pylist()
    assert len(scenes) == 3
    for scene in scenes:
        frame = int(scene["name"].rpartition("-")[2])
        lost = {
            line["id"]
            for line in table
            if line["frame"] == frame and line["cloud"] == "adv" and line["is_lost"]
        }
        assert lost == {"user0"}
        described = {box["id"]: box for box in scene["boxes"] if box["role"] == "truth"}
        assert {name for name, box in described.items() if box["outcome"] == "lost"} == lost
        assert {name: box["outcome"] for name, box in described.items()} == {
            "user0": "lost",
            "user1": "found",
            "user2": "found",
            "user3": "found",
            "user4": "ignored",  # out of range
            "user5": "ignored",  # without points
        }
        assert "1 lost" in scene["title"]


def test_the_story_of_a_lost_car(report):
    (box,) = (box for box in scenes_of(report)[0]["boxes"] if box["id"] == "user0")
    facts = {name: values for name, *values in box["facts"]}
    assert facts["LiDAR points"] == ["60", "15"]
    assert facts["score"] == ["0.60", "no box"]
    assert facts["IoU in 3D"] == ["1.00", "–"]
    assert facts["range"] == ["10.4 m"]
    assert box["lead"].startswith("Found on the clean cloud; on the attacked one no detection")


def test_predictions_of_both_clouds(report):
    boxes = [box for box in scenes_of(report)[0]["boxes"] if box["role"] == "prediction"]
    counts = {each: sum(box["condition"] == each for box in boxes) for each in ("clean", "attacked", "")}
    assert counts == {"clean": 4, "attacked": 3, "": 0}
    assert {box["outcome"] for box in boxes} == {"hit"}


def test_lanes_lie_in_the_scene(clean, tmp_path):
    """A lane 3 m left of the vehicle, which stands at (50, 20) and looks along y."""
    topics, map_SE3_base, base_SE3_lidar = VehicleTopics(), np.eye(4), np.eye(4)
    map_SE3_base[:2] = [[0, -1, 0, 50], [1, 0, 0, 20]]
    base_SE3_lidar[2, 3] = 1.8
    lane = np.array([[47.0, y, 0.0] for y in (0.0, 60.0)])
    reader = BagReader(clean)
    raws = list(reader.raw_messages())
    with BagWriter(tmp_path / "clean", provenance=reader.provenance) as bag:
        start_ns = raws[0].log_time_ns
        bag.write(LANES, lane_markers(start_ns, MAP_FRAME, [(lane, 3.5)]), start_ns)
        mounted = (topics.base_frame, topics.lidar_frame, base_SE3_lidar)
        bag.write(TF_STATIC, build.transforms(start_ns, [mounted]), start_ns)
        for raw in raws:
            bag.copy(raw)
            if raw.topic.name == topics.lidar_points.name:
                pose = (MAP_FRAME, topics.base_frame, map_SE3_base)
                bag.write(TF, build.transforms(raw.log_time_ns, [pose]), raw.log_time_ns)
    evaluate(tmp_path / "clean", out=tmp_path / "report", detector=DETECTOR, frames="0:8", workers=1)
    for scene in scenes_of(tmp_path / "report"):
        (line,) = scene["lines"]
        steps = np.frombuffer(base64.b64decode(line["xyz"]), "<i2").reshape(-1, 3) * line["unit_m"]
        assert line["kind"] == "lane"
        np.testing.assert_allclose(steps[[0, -1]], [[-20, 3, -1.8], [40, 3, -1.8]], atol=0.01)


def test_a_clean_bag_alone(clean, tmp_path):
    evaluate(clean, out=tmp_path / "report", detector=DETECTOR, frames="0:8", workers=1)
    scenes = scenes_of(tmp_path / "report")
    assert scenes
    for scene in scenes:
        assert not scene["is_attacked"]
        assert {box["condition"] for box in scene["boxes"]} == {""}
        assert scene["title"].endswith("every object found")


def test_a_report_without_a_scene(clean, attacked, tmp_path):
    bag = attacked(hide_first_car, frames=range(3))
    evaluate(clean, bag, out=tmp_path / "report", detector=DETECTOR, baseline=False, workers=1, scene=False)
    page = (tmp_path / "report" / "report.html").read_text()
    assert "adv-viewer" not in page
    assert "THREE" not in page
