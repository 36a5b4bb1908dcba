"""Stage 3 on a small clean bag: its figures against a brute-force evaluator of the rows it wrote."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from rosbags.highlevel import AnyReader
from scored import evaluate

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.geometry.boxes import BOX_COLUMNS, CLASSES, Boxes
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import CLOCK, VehicleTopics
from advpipe.pipeline.messages.types import typestore

FRAMES, PERIOD_NS = 12, 1_000_000_000  # two blocks
EGO = VehicleTopics("ego")
SIZES = np.array([[4.0, 2.0, 1.5], [8.0, 2.5, 3.0], [1.8, 0.7, 1.7], [0.8, 0.8, 1.8]])


def objects(index: int) -> Boxes:
    """Twelve objects on a grid, some of them out of the detector's range."""
    rng = np.random.default_rng([7, index])
    labels = rng.integers(0, 4, 12)
    grid = np.stack(np.meshgrid([-30, 0, 30, 62], [-24, 0, 24]), axis=-1).reshape(-1, 2)
    geometry = np.column_stack(
        [grid + rng.uniform(-6, 6, (12, 2)), np.zeros(12), SIZES[labels], rng.uniform(-3, 3, 12)]
    )
    return Boxes(geometry, labels, tuple(f"user{i}" for i in range(12)), np.zeros((12, 3)))


def cloud(index: int) -> np.ndarray:
    """Between 0 and 120 points in each object; the first point says which frame it is."""
    rng = np.random.default_rng([8, index])
    boxes = objects(index).geometry
    counts = rng.integers(0, 12, 12) ** 2
    inside = [
        box[:3] + rng.uniform(-0.3, 0.3, (n, 3)) * box[3:6].min()
        for box, n in zip(boxes, counts, strict=True)
    ]
    xyz = np.concatenate([[[index, 0, -50]], *inside])
    points = np.zeros(len(xyz), POINT_DTYPE)
    points["x"], points["y"], points["z"] = xyz.T
    return points


class WobblyDetector:
    """Sees most objects a little displaced, some twice, and some that are not there; scores have ties."""

    classes = ("cyclist", "car", "pedestrian", "truck")  # its own order, not ours
    range_m = Range(-50, -50, -3, 50, 50, 3)

    def detect(self, cloud):
        index = int(cloud["x"][0])
        rng, boxes = np.random.default_rng([9, index]), objects(index)
        seen = rng.choice(12, size=15)
        wobble = rng.normal(0, [0.2, 0.1, 0.1, 0.1, 0.05, 0.1, 0.1], (15, 7)) * rng.random((15, 1))
        ghosts = boxes.geometry[rng.choice(12, 3)] + [6, 6, 0, 0, 0, 0, 0]
        found = np.concatenate([boxes.geometry[seen] + wobble, ghosts])
        names = [CLASSES[label] for label in np.concatenate([boxes.labels[seen], rng.integers(0, 4, 3)])]
        scores = rng.integers(1, 10, 18) / 10
        order = np.argsort(-scores, kind="stable")
        labels = np.array([self.classes.index(name) for name in names])
        return Detections(found[order], scores[order], labels[order])

    def loss(self, points, boxes, labels):
        raise AssertionError("scoring asks for no gradient")


class ImpatientDetector(WobblyDetector):
    def detect(self, cloud):
        raise KeyboardInterrupt


DETECTOR = f"{__name__}:WobblyDetector"


def write_bag(path: Path, vehicles=(EGO,), frames: int = FRAMES) -> Path:
    with BagWriter(path, provenance={"kind": "clean"}) as bag:
        for index in range(frames):
            stamp_ns = 10**12 + index * PERIOD_NS
            bag.write(CLOCK, build.clock(stamp_ns), stamp_ns)
            for topics in vehicles:
                cdr = cloud_to_cdr(cloud(index), stamp_ns, topics.lidar_frame)
                bag.write_cdr(topics.lidar_points, cdr, stamp_ns)
            boxes = objects(index)
            truth = build.detections_message(stamp_ns, vehicles[0].lidar_frame, boxes)
            bag.write(vehicles[0].objects, truth, stamp_ns)
            users = build.road_users(
                stamp_ns, vehicles[0].lidar_frame, boxes, np.zeros(12), np.arange(12) / 12
            )
            bag.write(vehicles[0].road_users, users, stamp_ns)
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("drive") / "clean")


@pytest.fixture(scope="module")
def report(bag, tmp_path_factory):
    out = tmp_path_factory.mktemp("reports") / "first"
    evaluate(bag, [], out, detector=DETECTOR, detections=True)
    return out


def rows_of(report):
    return pq.read_table(str(report / "results.parquet")).to_pylist()


# --- an evaluator written from the definition: shapely's overlaps, every threshold from scratch

IOU = {"strict": (0.7, 0.7, 0.5, 0.5), "loose": (0.5, 0.5, 0.25, 0.25)}
RECALLS = {"ap_r40": [k / 40 for k in range(1, 41)], "ap_r11": [k / 10 for k in range(11)]}
LIMITS = {
    "range": {"0-30 m": (0, 30), "30-50 m": (30, 50), "over 50 m": (50, np.inf)},
    "points": {"5-19": (5, 20), "20-99": (20, 100), "100+": (100, np.inf)},
    "occlusion": {"0-10 %": (0, 0.1), "10-50 %": (0.1, 0.5), "over 50 %": (0.5, np.inf)},
}


def overlap(a, b, flat):
    def polygon(box):
        side = shapely.box(-box["length_m"] / 2, -box["width_m"] / 2, box["length_m"] / 2, box["width_m"] / 2)
        turned = shapely.affinity.rotate(side, box["yaw_rad"], origin=(0, 0), use_radians=True)
        return shapely.affinity.translate(turned, box["x_m"], box["y_m"])

    pa, pb = polygon(a), polygon(b)
    common, size_a, size_b = pa.intersection(pb).area, pa.area, pb.area
    if not flat:
        ends = [(box["z_m"] - box["height_m"] / 2, box["z_m"] + box["height_m"] / 2) for box in (a, b)]
        common *= max(0.0, min(e[1] for e in ends) - max(e[0] for e in ends))
        size_a, size_b = size_a * a["height_m"], size_b * b["height_m"]
    return common / (size_a + size_b - common)


def measure(row, by):
    if by == "range":
        return np.hypot(row["x_m"], row["y_m"])
    if row["kind"] == "detection":
        return {"points": max(row["points"], 5), "occlusion": None}[by]
    return row[by]


def evaluated_truth(rows):
    """The rule of the project: at least 5 points, and the centre in the range of `WobblyDetector`."""
    return [r["kind"] == "truth" and r["points"] >= 5 and abs(r["x_m"]) < 50 > abs(r["y_m"]) for r in rows]


def brute_force(rows, name, criterion, by="", stratum=""):
    """Objects, and AP at both sets of recalls: all detections of a class matched again at each threshold."""
    flat, kind = criterion.startswith("bev"), "loose" if criterion.endswith("loose") else "strict"
    least = IOU[kind][CLASSES.index(name)]
    low, high = LIMITS[by][stratum] if by else (-np.inf, np.inf)

    def inside(row):
        value = measure(row, by) if by else 0
        return value is None or low <= value < high

    frames = []
    for index in range(FRAMES):
        mine = [r for r in rows if r["frame"] == index and r["class"] == name]
        found = [r for r in mine if r["kind"] == "detection"]
        truth = [(r, e) for r, e in zip(mine, evaluated_truth(mine), strict=True) if r["kind"] == "truth"]
        iou = [[overlap(d, t, flat) for t, _ in truth] for d in found]
        frames.append((found, truth, iou))
    objects = sum(e and inside(t) for _, truth, _ in frames for t, e in truth)
    points = []
    for threshold in {d["score"] for found, _, _ in frames for d in found}:
        right = wrong = 0
        for found, truth, iou in frames:
            taken = set()
            for k in sorted(range(len(found)), key=lambda k: (-found[k]["score"], k)):
                if found[k]["score"] < threshold:
                    continue
                options = [(truth[m][1], iou[k][m], -m) for m in range(len(truth)) if m not in taken]
                options = [each for each in options if each[1] >= least]
                if options:
                    chosen = -max(options)[2]
                    taken.add(chosen)
                    right += truth[chosen][1] and inside(truth[chosen][0])
                else:
                    wrong += inside(found[k])
        points.append((right, wrong))
    if not objects:
        return 0, dict.fromkeys(RECALLS)
    return objects, {
        key: np.mean([
            max((r / (r + w) for r, w in points if r + w and r >= recall * objects - 1e-9), default=0.0)
            for recall in recalls
        ])
        for key, recalls in RECALLS.items()
    }  # fmt: skip


@pytest.mark.oracle
def test_every_average_precision_agrees_with_brute_force(report):
    rows = rows_of(report)
    records = json.loads((report / "report.json").read_text())["average_precision"]
    assert len(records) == 4 * 4 * (1 + 9)
    compared = 0
    for record in records:
        chosen = record["class"], record["criterion"]
        boxes, expected = brute_force(rows, *chosen, record["by"], record["stratum"])
        assert record["boxes"] == boxes
        for key, value in expected.items():
            assert record[key] == (None if value is None else pytest.approx(value, abs=1e-7)), record
            compared += value is not None and 0.0 < value < 1.0
    assert compared > 150  # no empty comparison


@pytest.mark.oracle
def test_rows_say_what_was_matched(report):
    rows = rows_of(report)
    outcomes_by_kind = {
        "detection": {"found", "false positive", "ignored"},
        "truth": {"found", "missed", "ignored"},
    }
    for kind, expected in outcomes_by_kind.items():
        assert {r["fate_strict"] for r in rows if r["kind"] == kind} == expected
    by_place = {(r["frame"], r["kind"], r["number"]): r for r in rows}
    for row, is_evaluated in zip(rows, evaluated_truth(rows), strict=True):
        if row["kind"] == "truth":
            assert (row["fate_strict"] != "ignored") == is_evaluated
            assert row["occlusion"] == pytest.approx(row["number"] / 12, abs=1e-6)
        other_kind = "truth" if row["kind"] == "detection" else "detection"
        for criterion in ("strict", "loose", "bev", "bev_loose"):
            match = row[f"match_{criterion}"]
            if match is None:
                assert row[f"fate_{criterion}"] != "found"
                continue
            other = by_place[row["frame"], other_kind, match]
            assert other[f"match_{criterion}"] == row["number"]
            assert other["class"] == row["class"]
            least = IOU["loose" if criterion.endswith("loose") else "strict"][CLASSES.index(row["class"])]
            assert overlap(row, other, criterion.startswith("bev")) >= least - 1e-9


def test_intervals_hold_what_they_should(report):
    records = json.loads((report / "report.json").read_text())["average_precision"]
    with_interval = [r for r in records if r["ap_r40_ci95"] is not None]
    assert with_interval
    for record in with_interval:
        low, high = record["ap_r40_ci95"]
        assert 0.0 <= low <= high <= 1.0
    (row,) = json.loads((report / "report.json").read_text())["rows"]
    assert row["blocks"] == 2
    low, high = row["map_clean_ci95"]
    assert low <= row["map_clean"] <= high


def test_the_report_does_not_fake_kittis_difficulty(report):
    page = (report / "report.html").read_text()
    assert "defined in a camera" in page
    assert "car alone" in page


def test_several_processes_write_the_same_bytes(bag, report, tmp_path, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[3])  # from where a process can import this module
    out = tmp_path / "again"
    evaluate(bag, [], out, detector=DETECTOR, detections=True, workers=2)
    files = [path.relative_to(report) for path in sorted(report.rglob("*")) if path.is_file()]
    assert len(files) == len([path for path in out.rglob("*") if path.is_file()]) > 8
    for file in files:
        assert (report / file).read_bytes() == (out / file).read_bytes(), file


@pytest.mark.oracle
def test_detections_are_written_back(bag, report):
    """Read by rosbags, which knows nothing of us."""
    rows = [r for r in rows_of(report) if r["kind"] == "detection"]
    with AnyReader([report / "detections" / "clean"], default_typestore=typestore()) as reader:
        connections = [c for c in reader.connections if c.topic == "/ego/detections"]
        assert [c.msgtype for c in connections] == ["vision_msgs/msg/Detection3DArray"]
        read = [
            (stamp_ns, reader.deserialize(raw, c.msgtype))
            for c, stamp_ns, raw in reader.messages(connections)
        ]
    assert len(read) == FRAMES
    found = []
    for index, (log_time_ns, message) in enumerate(read):
        assert log_time_ns == build.stamp_ns(message) == 10**12 + index * PERIOD_NS
        assert message.header.frame_id == "ego/lidar"
        for item in message.detections:
            centre, size, result = item.bbox.center, item.bbox.size, item.results[0].hypothesis
            yaw = 2 * np.arctan2(centre.orientation.z, centre.orientation.w)
            box = (centre.position.x, centre.position.y, centre.position.z, size.x, size.y, size.z, yaw)
            found.append((index, result.class_id, result.score, *box))
    assert len(found) == len(rows)
    for got, row in zip(found, rows, strict=True):
        assert got[:3] == (row["frame"], row["class"], row["score"])
        expected = [row[column] for column in BOX_COLUMNS]
        turns = (got[-1] - expected[-1]) / (2 * np.pi)
        assert turns == pytest.approx(round(turns), abs=1e-9)
        assert got[3:-1] == pytest.approx(expected[:-1])


@pytest.mark.parametrize("with_clouds", [False, True])
def test_everything_else_is_copied_byte_for_byte(bag, tmp_path, with_clouds):
    evaluate(bag, [], tmp_path / "report", detector=DETECTOR, detections=True, with_clouds=with_clouds)
    source, written = BagReader(bag), BagReader(tmp_path / "report" / "detections" / "clean")
    left_out = set() if with_clouds else {EGO.lidar_points.name}
    assert set(written.topics) == set(source.topics) - left_out | {"/ego/detections"}
    kept = [m for m in source.raw_messages() if m.topic.name not in left_out]
    copied = [m for m in written.raw_messages() if m.topic.name != "/ego/detections"]
    assert [(m.topic.name, m.log_time_ns, m.cdr) for m in copied] == [
        (m.topic.name, m.log_time_ns, m.cdr) for m in kept
    ]
    assert written.provenance["kind"] == "detections"


def test_one_of_several_lidars(tmp_path):
    two = (VehicleTopics("van", "top"), VehicleTopics("van", "rear"))
    bag = write_bag(tmp_path / "two", two, frames=2)
    with pytest.raises(AdvpipeError, match="several LiDAR topics and none is /ego/lidar/points; name one"):
        evaluate(bag, [], tmp_path / "report", detector=DETECTOR)
    with pytest.raises(AdvpipeError, match="no clouds on /van/front/points; it has /van/rear/points"):
        evaluate(bag, [], tmp_path / "report", detector=DETECTOR, lidar_topic="/van/front/points")
    assert not (tmp_path / "report").exists()
    name = two[0].lidar_points.name
    evaluate(bag, [], tmp_path / "report", detector=DETECTOR, lidar_topic=name, detections=True)
    (row,) = json.loads((tmp_path / "report" / "report.json").read_text())["rows"]
    assert row["frames"] == 2
    assert "/van/detections" in BagReader(tmp_path / "report" / "detections" / "clean").topics


def test_an_interrupted_run_leaves_nothing(bag, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        evaluate(bag, [], tmp_path / "reports" / "a", detector=f"{__name__}:ImpatientDetector")
    assert list(tmp_path.iterdir()) == []
