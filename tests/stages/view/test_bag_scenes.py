"""The frames of a bag as scenes: points, truth, what was heard, lanes and paths, each at its place."""

import shutil
from collections import Counter

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.labels.clouds import read_point_labels
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.messages.topics import V2X_STATIONS
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate
from advpipe.stages.view.run import open_scenes


@pytest.fixture(scope="module")
def scenes(dataset):
    return open_scenes(dataset)


def of_role(scene, role):
    return [box for box in scene.boxes if box.role == role]


def centres(boxes):
    return np.array([box.box[:2] for box in boxes])


def test_a_data_set_is_its_clean_bag_with_all_attacks(scenes, dataset):
    assert len(scenes) == 20
    assert scenes.names == ("cam", "detach", "gnss")
    assert scenes.labels[:2] == ["0: 0.00 s", "1: 0.10 s"]


def test_touched_points_are_those_of_the_labels(scenes, dataset):
    labels = {each.frame: each.labels for each in read_point_labels(dataset / "detach" / "labels.parquet")}
    for index in range(4):
        scene = scenes.scene(index, scenes.names.index("detach"))
        assert scene.difference.removed.tolist() == labels[index].point.tolist()
    before = next(iter(read_frames(dataset / "clean", FrameSlice(3, 4))))
    assert np.array_equal(scene.clean, before.cloud)


def test_a_frame_that_the_attack_left_out_is_the_clean_one(scenes):
    scene = scenes.scene(4, scenes.names.index("detach"))
    assert scene.attacked is None
    assert "no such frame" in scene.note
    assert scenes.scene(4, None).note == ""


def test_messages_are_attacked_also_where_the_attack_left_out_the_cloud(dataset):
    """Coordinated attacks change few clouds, and messages and fixes all the time."""
    attacks = (
        {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.02}, "frames": "0:4"},
        {"type": "cam-position-offset", "attackers": {"share": 0.5}},
        {"type": "gnss-bias", "victim": "ego"},
    )
    out = dataset.parent / "coordinated" / "adversarial"
    out.parent.mkdir()
    shutil.copytree(dataset / "clean", out.parent / "clean")
    attack(out.parent / "clean", out, AttackRequest(tuple(map(attack_spec, attacks))), workers=1)
    scene = open_scenes(out.parent).scene(19, 0)
    assert "no such cloud" in scene.note
    assert np.array_equal(scene.attacked, scene.clean)
    assert any((box.outcome, box.condition) == ("changed", "attacked") for box in of_role(scene, "ldm"))
    paths = {(line.kind, line.condition): line.places for line in scene.lines}
    assert not np.array_equal(paths["believed", "clean"], paths["believed", "attacked"])


def test_the_truth_has_its_stories(scenes, dataset):
    frame = next(iter(read_frames(dataset / "clean", FrameSlice(7, 8))))
    truth = of_role(scenes.scene(7, None), "truth")
    assert [box.id for box in truth] == list(frame.boxes.ids)
    assert any(int(fact.value) >= MIN_POINTS for box in truth for fact in box.facts if "points" in fact.name)
    assert {fact.name for fact in truth[0].facts} == {"range", "LiDAR points", "speed", "size"}


def test_honest_cams_and_map_entries_lie_on_their_stations(scenes, dataset):
    """Where the stations truly were, by the bag's own account; a CAM is up to a second old."""
    reader = BagReader(dataset / "clean")
    scene = scenes.scene(19, None)
    true = {box.id: box for box in of_role(scene, "truth")}
    names = {
        station.station_id: station.vehicle
        for _, message in reader.messages(V2X_STATIONS.name)
        for station in message.stations
    }
    for role, least in (("cam", 3), ("ldm", 3)):
        offsets_m = [
            np.hypot(*np.subtract(box.box[:2], true[name].box[:2]))
            for box in of_role(scene, role)
            if (name := names[int(box.id.split()[1])]) in true
        ]
        assert len(offsets_m) >= least
        assert np.median(offsets_m) < 3
        assert max(offsets_m) < 16  # a second of a fast car


def test_what_an_attack_says_is_apart_from_what_is_true(scenes):
    attacked = scenes.scene(19, scenes.names.index("cam"))
    outcomes = Counter((box.role, box.outcome, box.condition) for box in attacked.boxes)
    assert outcomes["ldm", "changed", "attacked"] > 0
    assert outcomes["ldm", "", "clean"] > 0
    assert outcomes["ldm", "", ""] > 0
    same = scenes.scene(19, scenes.names.index("gnss"))
    assert not any(box.outcome == "changed" for box in of_role(same, "cam"))


def test_lanes_and_paths(scenes):
    scene = scenes.scene(10, scenes.names.index("gnss"))
    kinds = Counter((line.kind, line.condition) for line in scene.lines)
    assert kinds["lane", ""] > 3
    assert kinds["true", ""] == kinds["believed", "clean"] == kinds["believed", "attacked"] == 1
    paths = {(line.kind, line.condition): line.places for line in scene.lines}
    now = paths["true", ""][10]  # the vehicle itself, below its LiDAR
    assert np.hypot(now[0], now[1]) < 3
    assert now[2] == pytest.approx(-1.8, abs=0.5)
    clean_m = np.linalg.norm(paths["believed", "clean"] - paths["true", ""], axis=1).max()
    attacked_m = np.linalg.norm(paths["believed", "attacked"] - paths["true", ""], axis=1).max()
    assert attacked_m > clean_m + 0.5


def test_one_attack_has_its_clean_bag_beside_it(dataset):
    assert open_scenes(dataset / "gnss").names == ("gnss",)
    assert open_scenes(dataset / "clean").names == ()


def test_a_bag_elsewhere_stands_alone(dataset, tmp_path):
    alone = shutil.copytree(dataset / "detach", tmp_path / "detach")
    scenes = open_scenes(alone)
    assert scenes.names == ()
    assert len(scenes) == 4
    scene = scenes.scene(0, None)
    assert scene.attacked is not None
    assert "debug topic" in scene.note
    before = next(iter(read_frames(dataset / "clean", FrameSlice(0, 1))))
    labels = next(iter(read_point_labels(dataset / "detach" / "labels.parquet"))).labels
    assert np.array_equal(xyz(scene.clean[scene.difference.removed]), xyz(before.cloud[labels.point]))
    assert len(scene.clean) == len(before.cloud)
    plain = attack_without_debug(dataset, tmp_path / "plain")
    assert open_scenes(plain).scene(0, None).attacked is None


def attack_without_debug(dataset, out):
    detach = {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.02}, "frames": "0:4"}
    request = AttackRequest((attack_spec(detach),), debug=False)
    attack(dataset / "clean", out, request, workers=1)
    return out


def test_a_bag_without_a_map_or_truth(dataset, tmp_path):
    with BagWriter(tmp_path / "bare", provenance={}) as writer:
        for raw in BagReader(dataset / "clean").raw_messages(["/ego/lidar/points"]):
            writer.copy(raw)
    scene = open_scenes(tmp_path / "bare").scene(3, None)
    assert len(scene.clean) > 1000
    assert (scene.boxes, scene.lines) == ((), ())


def test_bad_input_is_refused(dataset, tmp_path):
    with pytest.raises(UsageError, match="does not exist"):
        open_scenes(tmp_path / "nothing")
    (tmp_path / "text.mcap").write_text("no bag")
    with pytest.raises(AdvpipeError, match="not an MCAP file"):
        open_scenes(tmp_path / "text.mcap")
    with pytest.raises(UsageError, match="no clouds on /ego/other"):
        open_scenes(dataset, "/ego/other")


def test_a_frame_whose_truth_is_missing_is_named(dataset, tmp_path, scenes):
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        for number, raw in enumerate(BagReader(dataset / "clean").raw_messages()):
            if raw.topic.name != "/ego/ground_truth/objects" or number > 300:
                writer.copy(raw)
    with pytest.raises(AdvpipeError, match="no message of /ego/ground_truth/objects"):
        open_scenes(tmp_path / "bag").scene(0, None)


def test_topics_of_other_types_are_left_out(dataset, tmp_path):
    """Names of ours in another tool's bag: its messages are none that the viewer knows."""
    alike = {"/ego/ldm", "/ego/v2x/rx/raw", "/map/lanes", "/ego/odometry"}
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        for raw in BagReader(dataset / "clean").raw_messages():
            if raw.topic.name in alike:
                topic = Topic(raw.topic.name, "std_msgs/msg/String")
                writer.write(topic, build.string("lanes"), raw.log_time_ns)
            else:
                writer.copy(raw)
    scene = open_scenes(tmp_path / "bag").scene(15, None)
    assert {box.role for box in scene.boxes} == {"truth"}
    assert {line.kind for line in scene.lines} == {"true"}


def test_an_attack_on_clouds_leaves_the_radio_alone(scenes):
    """Its bag holds only what belongs to its frames: what is missing there was not dropped."""
    scene = scenes.scene(3, scenes.names.index("detach"))
    assert {box.condition for box in scene.boxes if box.role in ("cam", "ldm")} == {""}
    assert of_role(scene, "cam")


def test_what_debug_topics_show_stands_where_the_labels_say(scenes, dataset):
    scene = scenes.scene(19, scenes.names.index("cam"))
    rows = pq.read_table(dataset / "cam" / "v2x_labels.parquet").to_pylist()
    offsets_m = {
        round(float(np.hypot(row["true_x_m"] - row["false_x_m"], row["true_y_m"] - row["false_y_m"])), 3)
        for row in rows
    }
    claims = of_role(scene, "claim")
    assert Counter(box.outcome for box in claims)["claimed"] > 3
    places = {(box.outcome, box.title): np.array(box.box[:2]) for box in claims}
    for (outcome, title), place in places.items():
        if outcome == "claimed":
            offset_m = round(float(np.linalg.norm(place - places["true", title])), 3)
            assert min(abs(offset_m - each) for each in offsets_m) < 0.01
    assert {box.condition for box in claims} == {"attacked"}
    lines = [line for line in scene.lines if line.kind == "claim"]
    assert len(lines) == sum(box.outcome == "claimed" for box in claims)
    assert of_role(scenes.scene(19, None), "claim") == []


def test_spoofed_gps_shows_what_the_vehicle_believes(scenes):
    scene = scenes.scene(15, scenes.names.index("gnss"))
    (believed,) = (box for box in of_role(scene, "claim") if box.outcome == "believed")
    assert believed.facts[0].value == "gnss-bias"
    path = next(line for line in scene.lines if (line.kind, line.condition) == ("believed", "attacked"))
    assert np.linalg.norm(path.places - believed.box[:3], axis=1).min() < 0.5


@pytest.fixture(scope="module")
def drive_without_lidar(tmp_path_factory):
    path = tmp_path_factory.mktemp("radio") / "drive"
    settings = ("simulation.duration_s=2", "simulation.warmup_s=5", "v2x.penetration=1", "sensors.lidars={}")
    simulate(load_scenario("smoke", settings), path)
    request = AttackRequest((attack_spec({"type": "cam-drop", "attackers": {"share": 0.5}}),))
    attack(path / "clean", path / "drop", request, workers=1)
    return path


def test_a_bag_without_lidar(drive_without_lidar):
    scenes = open_scenes(drive_without_lidar)
    assert len(scenes) == 20
    scene = scenes.scene(19, 0)
    assert len(scene.clean) == 0
    outcomes = Counter((box.role, box.outcome) for box in scene.boxes)
    assert outcomes["truth", ""] > 3
    assert outcomes["claim", "withheld"] > 1
    assert outcomes["cam", ""] > 1
    assert outcomes["ldm", ""] > 1
    assert {line.kind for line in scene.lines} == {"lane", "true", "believed"}
    true = {box.facts[0].value: box.box[:2] for box in of_role(scene, "truth")}
    ages_m = [np.hypot(*np.subtract(box.box[:2], true[box.id.split()[1]])) for box in of_role(scene, "cam")]
    assert np.median(ages_m) < 3


def test_a_bag_with_neither_clouds_nor_poses(dataset, tmp_path):
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        for raw in BagReader(dataset / "clean").raw_messages([V2X_STATIONS.name, "/map/lanes"]):
            writer.copy(raw)
    with pytest.raises(UsageError, match="neither LiDAR clouds nor the true poses"):
        open_scenes(tmp_path / "bag")
