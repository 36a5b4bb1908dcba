"""What a report says of defences: their clean cost, and what they leave of attack and random-best."""

from functools import partial

import pyarrow.parquet as pq
import pytest
from place_drive import DETECTOR, FRAMES, hide_first_car, rows
from scored import document, unwrapped
from scored import evaluate as evaluate_with

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import print_report

evaluate = partial(evaluate_with, detector=DETECTOR)

DEFAULT = ["sample:drop=0.05", "outliers:k=2,sigmas=1.1", "quantise:step_m=0.01", "jitter:sigma_m=0.01",
           "shift:max_m=0.05", "flip"]  # fmt: skip

pytestmark = pytest.mark.usefixtures("no_pictures")


def test_defences(clean, attacked, tmp_path, capsys):
    """A detector that knows places: mirrored or scaled worlds are lost on it, a thinned one is not."""
    names = ["sample:0.02", "jitter:0.001", "flip", "shift:0.01", "outliers:sigmas=50"]
    report = evaluate(clean, [attacked(hide_first_car)], tmp_path / "report", defences=names)
    records = {each["defence"]: each for each in document(tmp_path / "report")["defences"]}
    assert list(records) == [
        "none", "sample:drop=0.02", "jitter:sigma_m=0.001", "flip", "shift:max_m=0.01",
        "outliers:k=2,sigmas=50",
    ]  # fmt: skip
    assert {each["frames"] for each in records.values()} == {FRAMES}  # all: these were asked for
    for name in ("none", "sample:drop=0.02", "jitter:sigma_m=0.001", "outliers:k=2,sigmas=50"):
        each = records[name]
        assert (each["map_clean"], each["clean_map_kept_percent"]) == (1.0, 100.0)
        assert each["map_adv"] == 26 / 40
        assert each["map_ratio_percent"] == each["map_adv_percent"] == 65.0
        assert each["map_ratio_ci95"] == [65.0, 65.0]
        # as many points taken at random hide nothing
        assert each["random_best_map_ratio_percent"] == 100.0
        assert each["map_ratio_delta_points_vs_random_best"] == -35.0
        assert each["map_ratio_delta_points_vs_random_best_ci95"] == [-35.0, -35.0]
        assert each["significant_vs_random_best"] is None  # two blocks
        assert each["clean_map_loose_kept_percent"] == 100.0
        assert each["map_loose_ratio_percent"] == 65.0
        assert each["random_best_map_loose_ratio_percent"] == 100.0
        assert each["map_loose_ratio_delta_points_vs_random_best"] == -35.0
        assert each["map_loose_ratio_delta_points_vs_random_best_ci95"] == [-35.0, -35.0]
    (row,) = rows(tmp_path / "report")
    for kind in ("", "loose_"):
        of_attack, random = row[f"map_{kind}ratio_percent"], row[f"random_best_map_{kind}ratio_percent"]
        assert row[f"map_{kind}ratio_delta_points_vs_random_best"] == of_attack - random
    # in a mirrored world none of the places holds points any more
    assert records["flip"]["map_clean"] == records["flip"]["clean_map_kept_percent"] == 0.0
    assert records["flip"]["map_ratio_percent"] is records["flip"]["random_best_map_ratio_percent"] is None
    assert 0 < records["shift:max_m=0.01"]["map_clean"] <= 1.0
    print_report(report)
    said = (
        f"on {FRAMES} of {FRAMES} frames, mAP ratio (of random-best, 1 try): none 65 % (100 %), sample:drop"
    )
    assert said in unwrapped(capsys)


def test_six_defences_by_default_on_a_third_of_the_frames(clean, attacked, tmp_path):
    bag = attacked(hide_first_car)
    evaluate(clean, [bag], tmp_path / "report", defences=Options.defences)
    made = document(tmp_path / "report")
    assert [each["defence"] for each in made["defences"]] == ["none", *DEFAULT]
    assert made["provenance"]["defences"] == DEFAULT
    assert {each["frames"] for each in made["defences"]} == {FRAMES // 3}
    assert rows(tmp_path / "report")[0]["frames"] == FRAMES
    seen = pq.read_table(str(tmp_path / "report" / "results.parquet")).to_pylist()
    under = {line["cloud"]: set() for line in seen}
    for line in seen:
        under[line["cloud"]].add(line["frame"])
    for condition in ("clean", "adv", "random_best"):
        assert under[f"{condition} under flip"] <= {1, 4, 7, 10, 13, 16}  # the middles of six parts
        assert under[f"{condition} under jitter:sigma_m=0.01"] == {1, 4, 7, 10, 13, 16}
    page = (tmp_path / "report" / "report.html").read_text()
    assert f"on {FRAMES // 3} of {FRAMES} frames" in page
    assert (
        f"no interval: {FRAMES // 3} frames" not in page
    )  # a column that would say nothing else is left out


def test_frames_are_those_that_a_bag_holds(clean, attacked, tmp_path):
    held = {"odd": range(1, 8, 2), "few": range(12, 14)}
    bags = [attacked(hide_first_car, name, frames=frames) for name, frames in held.items()]
    evaluate(clean, bags, tmp_path / "report", defences=["sample"], defence_frames=2)
    seen = pq.read_table(str(tmp_path / "report" / "results.parquet")).to_pylist()
    for condition in ("clean", "adv"):
        under = {
            (line["bag"], line["frame"])
            for line in seen
            if line["cloud"] == f"{condition} under sample:drop=0.05"
        }
        assert under == {("odd", 3), ("odd", 7), ("few", 12), ("few", 13)}


def test_no_defence(clean, attacked, tmp_path):
    evaluate(
        clean, [attacked(hide_first_car)], tmp_path / "report", defences=["none"], frames=FrameSlice(0, 2)
    )
    assert "defences" not in document(tmp_path / "report")


def test_defences_on_a_clean_bag_alone(clean, tmp_path, capsys):
    report = evaluate(clean, [], tmp_path / "report", defences=["sample"], frames=FrameSlice(0, 4))
    undefended, record = document(tmp_path / "report")["defences"]
    assert undefended["clean_map_kept_percent"] == record["clean_map_kept_percent"] == 100.0
    assert not {"map_adv", "random_best_map_adv"} & record.keys()
    print_report(report)
    assert "on 4 of 4 frames, mAP kept: sample:drop=0.05 100 %." in unwrapped(capsys)


def test_boxes_come_back_from_a_flipped_world(clean, attacked, tmp_path):
    evaluate(clean, [], tmp_path / "report", detector="place_drive:MirroredDetector", defences=["flip"])
    (row,) = rows(tmp_path / "report")
    _, record = document(tmp_path / "report")["defences"]
    assert row["map_clean"] == 0.0
    assert record["map_clean"] == record["ap_car_clean"] == 1.0


@pytest.mark.parametrize(("frames", "most"), [(1, 1), (3, 1), (8, 3), (20, 7), (30, 10), (600, 10)])
def test_default_defences_take_a_third_of_the_frames_and_at_most_ten(frames, most):
    assert Options().most_defended(frames) == most
    assert Options(defences=("flip",)).most_defended(frames) == frames
    assert Options(defence_frames=5).most_defended(frames) == 5
