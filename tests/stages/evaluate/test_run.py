"""Stage 3 on small bags written here, with a small detector of its own; the figures are checked by hand."""

import json
import re

import numpy as np
import pyarrow.parquet as pq
import pytest
from place_drive import DETECTOR, FRAMES, clean_cloud, hide_first_car, rows
from scipy.spatial.distance import cdist
from scored import evaluate

from advpipe.pipeline.core.errors import OutputExistsError
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.evaluate.run import print_report


@pytest.mark.usefixtures("no_pictures")
def test_figures_by_hand(clean, attacked, tmp_path, capsys):
    report = evaluate(clean, [attacked(hide_first_car)], tmp_path / "report", detector=DETECTOR)
    (row,) = rows(tmp_path / "report")

    assert (row["attack"], row["recipe"], row["parameter"], row["value"]) == (
        "detach",
        "best",
        "ratio",
        0.014,
    )
    assert row["frames"] == FRAMES
    # three cars a frame are evaluated, not the one out of range nor the one without points
    assert (row["boxes_car"], row["boxes_pedestrian"]) == (3 * FRAMES, FRAMES)
    assert row["classes_in_map"] == ["car"]  # 18 pedestrians are fewer than 50
    assert row["map_clean"] == row["ap_car_clean"] == row["ap_pedestrian_clean"] == 1.0
    # two of three cars are found: precision 1 up to recall 2/3, that is at 26 of 40 positions
    assert row["map_adv"] == row["ap_car_adv"] == row["ap_loose_car_adv"] == row["ap_bev_car_adv"] == 26 / 40
    assert row["map_ratio_percent"] == 65.0
    assert row["map_ratio_ci95"] == [65.0, 65.0]  # every frame is alike
    assert row["ap_pedestrian_adv"] == 1.0
    # the same number of points taken at random hides nothing
    assert row["baseline_map_ratio_percent"] == 100.0
    assert row["map_ratio_delta_points_vs_baseline"] == -35.0
    assert row["map_ratio_delta_points_vs_baseline_ci95"] == [-35.0, -35.0]
    assert row["points_removed"] == row["baseline_points_removed"] == 45 * FRAMES
    assert row["points_added"] == row["max_displacement_m"] == 0
    assert (row["lost_objects"], row["baseline_lost_objects"]) == (FRAMES, 0)
    assert row["new_false_positives"] == row["objects_below_min_points"] == 0

    print_report(report)
    printed = capsys.readouterr().out
    assert "65.00" in printed
    assert "  randomly anywhere" in printed
    assert printed.count("no interval") == 1
    text = " ".join(printed.split())
    assert "Tables show no interval: that takes 6 blocks of 5 s, and the frames fill 2." in text


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.oracle
def test_chamfer_distance_is_the_mean_over_frames(clean, attacked, tmp_path):
    evaluate(clean, [attacked(hide_first_car, frames=range(3))], tmp_path / "report", detector=DETECTOR)
    expected = []
    for index in range(3):
        squared = (
            cdist(*(xyz(c).astype(float) for c in (clean_cloud(index), hide_first_car(clean_cloud(index)))))
            ** 2
        )
        expected.append(squared.min(axis=1).mean() + squared.min(axis=0).mean())
    assert rows(tmp_path / "report")[0]["chamfer_distance_m2"] == pytest.approx(np.mean(expected), rel=1e-6)


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("provenance", [{}, {"slice": "4:12:2"}])
def test_some_frames_only(clean, attacked, tmp_path, provenance):
    part = attacked(hide_first_car, frames=range(4, 12, 2), **provenance)
    evaluate(clean, [part], tmp_path / "report", detector=DETECTOR)
    (row,) = rows(tmp_path / "report")
    assert row["frames"] == 4
    assert row["boxes_car"] == 12
    # no class has 50 boxes: all that have any count, and the report says so
    assert row["classes_in_map"] == ["car", "pedestrian"]
    assert any("No class has 50" in note for note in row["notes"])
    assert row["map_ratio_percent"] == pytest.approx(100 * (26 / 40 + 1) / 2)
    assert row["map_ratio_ci95"] is None  # 4 s are less than two blocks
    assert any("and the frames fill 1" in note for note in row["notes"])
    document = json.loads((tmp_path / "report" / "report.json").read_text())
    assert document["provenance"]["compared"][0]["frames"] == [4, 6, 8, 10]


@pytest.mark.usefixtures("no_pictures")
def test_moved_and_added_points(clean, attacked, tmp_path):
    def shift(cloud):
        cloud["x"][:60] += np.float32(6.0)  # the first car's points leave it
        return cloud

    def double(cloud):
        return np.concatenate([cloud, cloud[:5]])

    evaluate(
        clean,
        [attacked(shift, "shift", range(2), recipe="a"), attacked(double, "double", range(2), recipe="b")],
        tmp_path / "report",
        detector=DETECTOR,
    )
    moved, added = rows(tmp_path / "report")
    assert (moved["points_moved"], moved["points_removed"], moved["points_added"]) == (120, 0, 0)
    assert moved["baseline_points_moved"] == 120
    assert moved["max_displacement_m"] == pytest.approx(6.0, abs=1e-5)
    assert moved["lost_objects"] == 2
    assert moved["objects_below_min_points"] == 2
    assert (added["points_moved"], added["points_removed"], added["points_added"]) == (0, 0, 10)
    assert added["baseline_points_added"] == 10
    assert added["map_ratio_percent"] == 100.0


@pytest.mark.usefixtures("no_pictures")
def test_random_recipe_is_given_no_baseline(clean, attacked, tmp_path):
    bag = attacked(hide_first_car, frames=range(2), recipe="random")
    evaluate(clean, [bag], tmp_path / "report", detector=DETECTOR)
    (row,) = rows(tmp_path / "report")
    assert row["map_adv"] is not None
    assert row["baseline_map_adv"] is None
    assert row["map_ratio_delta_points_vs_baseline"] is None


def test_clean_bag_alone(clean, tmp_path, capsys):
    report = evaluate(clean, [], tmp_path / "report", detector=DETECTOR)
    (row,) = rows(tmp_path / "report")
    assert (row["attack"], row["frames"], row["map_clean"]) == ("none", FRAMES, 1.0)
    assert row["map_adv"] is row["map_ratio_percent"] is row["chamfer_distance_m2"] is None
    figures = {path.name for path in (tmp_path / "report" / "figures").glob("*.png")}
    assert {"precision_recall.png", "strata.png"} <= figures
    assert len(figures) == 2 + 4 + 2  # two of the worst frames, two of the best, and the worst in two shapes
    print_report(report)
    printed = capsys.readouterr().out
    assert "mAP 1.000; car alone 1.000" in printed


@pytest.mark.usefixtures("no_pictures")
def test_detector_that_finds_nothing(clean, attacked, tmp_path, capsys):
    bag = attacked(hide_first_car, frames=range(2))
    report = evaluate(clean, [bag], tmp_path / "report", detector="place_drive:BlindDetector")
    (row,) = rows(tmp_path / "report")
    assert row["map_clean"] == row["map_adv"] == 0.0
    assert row["map_ratio_percent"] is None
    undefined = "undefined: nothing found on the clean bag"
    assert any(f"mAP ratio {undefined}" in note for note in row["notes"])
    assert "100.00" not in (page := (tmp_path / "report" / "report.html").read_text())
    assert page.count(f'<td class="ratio">{undefined}</td>') == 2 + len(row["baselines"])
    print_report(report)
    printed = " ".join(capsys.readouterr().out.split())
    assert "100.00" not in printed
    assert undefined in printed
    assert undefined in str(report)


def test_folder_holds_the_whole_report(clean, attacked, tmp_path):
    out = tmp_path / "reports" / "first"
    evaluate(clean, [attacked(hide_first_car, frames=range(6))], out, detector=DETECTOR)
    assert sorted(p.name for p in out.iterdir()) == [
        "figures",
        "frames.parquet",
        "report.html",
        "report.json",
        "results.parquet",
    ]
    table = pq.read_table(str(out / "frames.parquet")).to_pylist()
    assert [line["frame"] for line in table] == list(range(6))
    assert all(line["lost_objects_adv"] == 1 and line["lost_objects_baseline"] == 0 for line in table)
    assert all(line["found_objects_clean"] == 4 and line["points_removed_adv"] == 45 for line in table)

    page = (out / "report.html").read_text()
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:|#)""", page)  # needs no other file, no network
    shown = set(re.findall(r'src(?:set)?="(data:image/(?:png;base64|svg\+xml),[^"]+)"', page))
    assert len(shown) == len(list((out / "figures").glob("*.png")))
    assert "82.50" in page  # (26/40 + 1) / 2: car and pedestrian


def test_same_input_same_bytes(clean, attacked, tmp_path):
    bag = attacked(hide_first_car, frames=range(6))
    for name in ("a", "b"):
        evaluate(clean, [bag], tmp_path / name, detector=DETECTOR, seed=3)
    files = [p.relative_to(tmp_path / "a") for p in sorted((tmp_path / "a").rglob("*")) if p.is_file()]
    assert len(files) > 4
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file


@pytest.mark.usefixtures("no_pictures")
def test_existing_report_is_kept(clean, tmp_path):
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "report.json").write_text("mine")
    with pytest.raises(OutputExistsError):
        evaluate(clean, [], tmp_path / "report", detector=DETECTOR)
    assert (tmp_path / "report" / "report.json").read_text() == "mine"
    evaluate(clean, [], tmp_path / "report", detector=DETECTOR, overwrite=True)
    assert rows(tmp_path / "report")[0]["map_clean"] == 1.0


@pytest.mark.usefixtures("no_pictures")
def test_budget_is_the_parameter_that_the_attack_names(clean, attacked, tmp_path):
    parameters = json.dumps({"depth": 2, "ratio": 0.014})
    bag = attacked(hide_first_car, frames=range(2), parameters=parameters, budget="ratio")
    evaluate(clean, [bag], tmp_path / "report", detector=DETECTOR)
    (row,) = rows(tmp_path / "report")
    assert (row["parameter"], row["value"]) == ("ratio", 0.014)
