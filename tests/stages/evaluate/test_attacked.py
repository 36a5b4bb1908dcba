"""What a report says of attacked bags: baselines, success, recount, transfer, frames, curves."""

import json
from functools import partial

import numpy as np
import pyarrow.parquet as pq
import pytest
from jsonschema import Draft202012Validator
from place_drive import DETECTOR, FRAMES, clean_cloud, hide_first_car, rows, write_bag
from scored import document
from scored import evaluate as evaluate_with

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.results.schema import report_schema
from advpipe.stages.evaluate.run import print_report

evaluate = partial(evaluate_with, detector=DETECTOR)
KEEN = "place_drive:KeenDetector"


pytestmark = pytest.mark.usefixtures("no_pictures")  # other tests draw them


def move_first_car(cloud):
    """The 60 points of place 0 go 6 m ahead."""
    cloud["x"][:60] += np.float32(6.0)
    return cloud


def empty_first_car(cloud):
    """Leaves 3 of its 60 points."""
    return cloud[57:]


def test_moved_points(clean, attacked, tmp_path):
    """Perturbed bags are given the third baseline: every point by the stated bound."""
    bag = attacked(move_first_car, parameters=json.dumps({"eps_cm": 600}), attack="perturb")
    evaluate(clean, [bag], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["baselines"] == ["random_best", "baseline", "baseline_near", "baseline_full"]
    assert (row["parameter"], row["value"]) == ("eps_cm", 600)
    for prefix in ("", "baseline_", "baseline_near_"):
        assert row[f"{prefix}points_moved"] == 60 * FRAMES
        assert row[f"{prefix}mean_displacement_m"] == pytest.approx(6.0, abs=1e-5)
    assert row["baseline_full_points_moved"] == row["points_clean"]
    assert row["baseline_full_max_displacement_m"] <= 6.0
    assert row["rms_displacement_m"] == pytest.approx(6.0, abs=1e-5)
    assert row["median_displacement_m"] == pytest.approx(row["p95_displacement_m"])
    assert row["points_off_ray"] == 60 * FRAMES
    assert row["at_face_percent"] is row["at_face_clean_percent"] is None  # a detector without voxels
    assert f"{60 * FRAMES:,} (100.0 %)" in (tmp_path / "report" / "report.html").read_text()


def test_attack_success_by_class_and_range(clean, attacked, tmp_path):
    """Place 0, a car at 10.4 m, is lost in every frame; the other cars and the pedestrian lie within 30 m."""
    evaluate(clean, [attacked(hide_first_car)], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["attack_success_percent"] == 25.0  # one of four
    records = {
        (each["class"], each["range"]): each
        for each in document(tmp_path / "report")["attack_success"]
        if each["condition"] == "adv"
    }
    assert len(records) == 3 * 4
    whole, cars, near = records["all", "all"], records["car", "all"], records["car", "0-30 m"]
    assert (whole["found_clean"], whole["lost"], whole["attack_success_percent"]) == (
        4 * FRAMES,
        FRAMES,
        25.0,
    )
    assert whole["attack_success_ci95"] == [25.0, 25.0]
    assert (cars["found_clean"], cars["lost"]) == (near["found_clean"], near["lost"]) == (3 * FRAMES, FRAMES)
    assert (records["pedestrian", "all"]["lost"], records["car", "30-50 m"]["found_clean"]) == (0, 0)
    assert records["car", "30-50 m"]["attack_success_percent"] is None


def test_new_false_positives_by_class(clean, attacked, tmp_path):
    """30 points in the sixth place, which no ray hits: the detector sees a car there that has no points.

    The object is ignored, so the car is no false positive; moved 3 m away it would be one.
    """

    def ghost(cloud):
        new = cloud[60:90].copy()
        new["x"] += 25 - 18
        new["y"] += 15 + 4
        return np.concatenate([cloud, new])

    bag = attacked(ghost, frames=range(4), attack="attach", parameters=json.dumps({"eps_m": 25.0}))
    evaluate(clean, [bag], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["points_added"] == row["baseline_points_added"] == row["baseline_near_points_added"] == 120
    assert row["new_false_positives"] == 0
    assert row["max_added_m"] > 1.0
    # recounted on the attacked clouds it is an object, and found
    assert row["objects_recounted"] == row["objects"] + 4
    assert row["map_ratio_percent_recounted"] == row["map_ratio_percent"] == 100.0


def test_recount_on_the_attacked_clouds(clean, attacked, tmp_path):
    """With 3 points left the first car is no object to find any more: recounted, nothing is lost."""
    evaluate(clean, [attacked(empty_first_car)], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["objects_below_min_points"] == FRAMES
    assert (row["objects"], row["objects_recounted"]) == (4 * FRAMES, 3 * FRAMES)
    assert (row["map_ratio_percent"], row["map_ratio_percent_recounted"]) == (65.0, 100.0)
    assert (row["lost_objects"], row["lost_objects_recounted"]) == (FRAMES, 0)
    assert (row["attack_success_percent"], row["attack_success_percent_recounted"]) == (25.0, 0.0)
    assert row["map_ratio_recounted_ci95"] == [100.0, 100.0]


def test_recount_without_emptied_objects_is_the_same(clean, attacked, tmp_path):
    evaluate(clean, [attacked(hide_first_car, frames=range(3))], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["map_ratio_percent_recounted"] == row["map_ratio_percent"]
    assert row["objects_recounted"] == row["objects"]


def test_results_say_what_was_lost(clean, attacked, tmp_path):
    bag = attacked(empty_first_car, frames=range(4))
    evaluate(clean, [bag], tmp_path / "report", defences=["flip"])
    lines = pq.read_table(str(tmp_path / "report" / "results.parquet")).to_pylist()
    assert {line["cloud"] for line in lines} == {
        "clean", "adv", "random_best", "baseline", "baseline_near",
        "clean under flip", "adv under flip", "random_best under flip",
    }  # fmt: skip
    assert {line["detector"] for line in lines} == {DETECTOR}
    lost = [line for line in lines if line["is_lost"]]
    assert {(line["cloud"], line["kind"], line["id"]) for line in lost} >= {("adv", "truth", "user0")}
    assert len([line for line in lost if line["cloud"] == "adv"]) == 4
    emptied = [(line["cloud"], line["id"]) for line in lines if line["is_emptied"]]
    assert emptied == [("adv", "user0")] * 4
    assert not any(line["is_new"] for line in lines)


def test_transfer_matrix(clean, attacked, tmp_path, capsys):
    """15 points are left of the first car: PlaceDetector needs 20, KeenDetector 12."""
    from advpipe.pipeline.detector.registry import detector_sha256

    about = {"detector": DETECTOR, "detector_sha256": detector_sha256(DETECTOR)}
    other = {"detector": "third", "detector_sha256": "f" * 64, "recipe": "best"}
    bags = [attacked(hide_first_car, "one", **about), attacked(hide_first_car, "two", **other)]
    report = evaluate(clean, bags, tmp_path / "report", detector=[DETECTOR, KEEN], baseline=False)
    made = rows(tmp_path / "report")
    assert [(row["bag"], row["detector"], row["map_ratio_percent"]) for row in made] == [
        ("one", DETECTOR, 65.0), ("two", DETECTOR, 65.0), ("one", KEEN, 100.0), ("two", KEEN, 100.0),
    ]  # fmt: skip
    records = document(tmp_path / "report")["transfer"]
    matrix = {(r["attacked_against"], r["evaluated_with"]): r["map_ratio_percent"] for r in records}
    assert matrix == {
        (DETECTOR, DETECTOR): 65.0, (DETECTOR, KEEN): 100.0,
        ("third", DETECTOR): 65.0, ("third", KEEN): 100.0,
    }  # fmt: skip
    assert [r["evaluated_with"] for r in records if r["is_white_box"]] == [DETECTOR]
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Transfer between detectors" in page
    assert "<td>65.0 *</td>" in page
    print_report(report)
    assert "KeenDetector" in capsys.readouterr().out


def test_chosen_frames_of_chosen_frames(clean, attacked, tmp_path):
    """The bag holds every second frame from 4 to 16; of those, every fourth one of the drive is asked for."""
    part = attacked(hide_first_car, frames=range(4, 18, 2), slice="4:18:2")
    evaluate(clean, [part], tmp_path / "report", frames=FrameSlice(0, None, 4))
    (row,) = rows(tmp_path / "report")
    assert row["frames"] == 4
    assert row["objects_found_clean"] == 16  # clean figures are of the same frames
    assert document(tmp_path / "report")["provenance"]["compared"][0]["frames"] == [4, 8, 12, 16]
    table = pq.read_table(str(tmp_path / "report" / "frames.parquet")).to_pylist()
    assert [line["frame"] for line in table] == [4, 8, 12, 16]
    assert all(line["points_removed_adv"] == 45 and line["lost_objects_adv"] == 1 for line in table)


def test_a_bag_whose_clouds_nobody_attacked_is_not_looked_at(clean, attacked, tmp_path):
    replayed = json.dumps([{"type": "cam-replay", "declared": {"family": "v2x"}}])
    bags = [
        attacked(hide_first_car, "clouds", range(2)),
        attacked(lambda cloud: cloud, "lies", range(2), attack="cam-replay", attacks=replayed),
    ]
    evaluate(clean, bags, tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["bag"] == "clouds"
    compared = document(tmp_path / "report")["provenance"]["compared"]
    assert [(each["bag"], each["frames"]) for each in compared] == [("clouds", [0, 1]), ("lies", [])]
    report = evaluate(clean, bags[1:], tmp_path / "other")
    assert report.rows == ()
    assert "lies" in (tmp_path / "other" / "report.html").read_text()
    print_report(report)


def test_curves_of_several_budgets(clean, attacked, tmp_path):
    bags = [
        attacked(
            lambda cloud, count=count: cloud[count:],
            f"remove{count}",
            range(4),
            parameters=json.dumps({"ratio": count / 3000}),
        )
        for count in (5, 30, 45)
    ]
    evaluate(clean, bags, tmp_path / "report", baseline_tries=2)
    figures = {path.name for path in (tmp_path / "report" / "figures").glob("*.png")}
    assert {"map_ratio.png", "budget1.png"} <= figures
    assert "budget2.png" not in figures


def test_places_hold_what_the_tests_count(clean):
    """The figures above rest on this: 60, 50, 40 and 30 points in the first four places, and few others."""
    from place_drive import PLACES, clean_cloud

    for index in range(3):
        assert count_points(xyz(clean_cloud(index)), PLACES)[:4].tolist() == [60, 50, 40, 30]


def test_a_frame_without_points_is_none_to_lose(tmp_path):
    """No echo came back: no attack can touch it, and it is no reason to score no other frame."""
    clouds = {index: clean_cloud(index)[: 0 if index == 1 else None] for index in range(FRAMES)}
    clean = write_bag(tmp_path / "clean", {"kind": "clean"}, clouds)
    about = {"kind": "attack", "attack": "detach", "recipe": "best", "parent_sha256": parent_sha256(clean)}
    evaluate(clean, [write_bag(tmp_path / "attacked", about, clouds)], tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert (row["frames"], row["map_ratio_percent"], row["chamfer_distance_m2"]) == (FRAMES, 100.0, 0.0)


def test_a_real_report_keeps_to_the_published_schema(clean, attacked, tmp_path):
    """With baselines, a defence, two detectors and so transfer; and one of the clean bag alone."""
    bags = [attacked(hide_first_car)]
    out = tmp_path / "report"
    some = FrameSlice(0, None, 3)  # still two blocks, and so intervals
    evaluate(clean, bags, out, detector=[DETECTOR, KEEN], defences=["flip"], baseline_tries=2, frames=some)
    evaluate(clean, [], tmp_path / "alone", defences=["flip"], frames=some)
    validator = Draft202012Validator(report_schema())
    for folder in (out, tmp_path / "alone"):
        report = json.loads((folder / "report.json").read_text())
        assert report["schema"] == "advpipe-report-2"
        assert [error.message for error in validator.iter_errors(report)] == []
        assert report["deprecated_keys"]["beats_random"] == "significant_vs_random"
        assert report["rows"][0]["blocks"] == 2
        assert report["rows"][0]["beats_random"] is report["rows"][0]["significant_vs_random"]
    assert {"attack_success", "baselines", "defences"} <= json.loads((out / "report.json").read_text()).keys()
