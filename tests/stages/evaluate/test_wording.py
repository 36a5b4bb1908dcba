"""A report says by which overlap and from which score objects are lost, and what its baselines are not."""

import json

import numpy as np
import pytest
from place_drive import FRAMES, PLACES, PlaceDetector, hide_first_car
from scored import evaluate

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.evaluate.report.terminal import SHORT_BASELINES, SHORT_WHITE_BOX
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, WHITE_BOX
from advpipe.stages.evaluate.run import print_report


class MisplacingDetector(PlaceDetector):
    """Sees the first car, 2 m wide, 50 cm beside its place where that holds less than its 60 points: the
    overlap is 0.6, a miss at strict overlap alone."""

    least = 10

    def detect(self, cloud):
        found = super().detect(cloud)
        if count_points(xyz(cloud), PLACES[:1])[0] >= 60:
            return found
        boxes = found.boxes.copy()
        first = np.isclose(boxes[:, :2], PLACES[0, :2]).all(axis=1)
        yaw = PLACES[0, 6]
        boxes[first, :2] += 0.5 * np.array([-np.sin(yaw), np.cos(yaw)])
        return Detections(boxes, found.scores, found.labels)


pytestmark = pytest.mark.usefixtures("no_pictures")


def text_of(page):
    return " ".join(page.split())


def test_both_overlaps_and_the_score_stand_where_lost_stands(clean, attacked, tmp_path, capsys):
    bag = attacked(lambda cloud: cloud[30:])
    report = evaluate(clean, [bag], tmp_path / "report", detector="test_wording:MisplacingDetector")
    (row,) = report.rows
    assert row["lost_objects"] == 0  # its box is there, but off
    (whole,) = [
        each
        for each in json.loads((tmp_path / "report" / "report.json").read_text())["attack_success"]
        if (each["condition"], each["class"], each["range"]) == ("adv", "all", "all")
    ]
    found = 4 * FRAMES
    assert (whole["found_clean"], whole["lost"], whole["attack_success_percent"]) == (found, 0, 0.0)
    assert (whole["strict_found_clean"], whole["strict_lost"]) == (found, FRAMES)
    assert whole["strict_attack_success_percent"] == 25.0
    assert whole["strict_attack_success_ci95"] == [25.0, 25.0]
    assert whole["min_score"] == row["working_score"] == pytest.approx(0.15)  # half of the lowest
    print_report(report)
    printed = text_of(capsys.readouterr().out)
    assert "at loose overlap and a score of at least 0.15" in printed
    assert (
        f"the detector loses {FRAMES} of {found} (25.0 %) at strict overlap, 0 of {found} (0.0 %) at loose"
        in printed
    )
    page = text_of((tmp_path / "report" / "report.html").read_text())
    assert "missed here, at loose overlap and a score of at least 0.15; new FP" in page
    assert ">strict: lost of found</a></th>" in page
    assert ">loose, all: lost of found</a></th>" in page
    (effect,) = [
        each
        for each in json.loads((tmp_path / "report" / "report.json").read_text())["attack_effects"]
        if each["condition"] == "adv"
    ]
    assert (effect["lost_objects"], effect["displaced_objects"]) == (0, FRAMES)
    assert effect["displaced_percent"] == 25.0
    assert f"0 of {found} found objects are not found any more; {FRAMES} more are displaced" in page
    assert "with a score of at least 0.15, and by the overlap in the column&#39;s head" in page


def test_the_baselines_are_called_what_they_are(clean, attacked, tmp_path, capsys):
    report = evaluate(
        clean, [attacked(hide_first_car)], tmp_path / "report", detector="place_drive:PlaceDetector"
    )
    print_report(report)
    printed = text_of(capsys.readouterr().out)
    page = text_of((tmp_path / "report" / "report.html").read_text())
    for tag in ("<code>", "</code>"):
        page = page.replace(tag, "`")
    assert SHORT_BASELINES in printed
    assert SHORT_WHITE_BOX in printed
    assert ABOUT_BASELINES in page.replace("&#39;", "'")
    assert WHITE_BOX in page.replace("&#39;", "'")
    for text in (printed, page.replace("&#39;", "'")):
        assert "Δ of the mAP ratio to random-best, 1 try: " in text
        assert "Significant" not in text  # of three blocks nothing is said
    document = json.loads((tmp_path / "report" / "report.json").read_text())
    assert "random-best lies below 0" in document["formulas"]["significant_vs_random"]
    assert "true boxes" in document["formulas"]["white_box"]


def test_without_an_attack_there_is_nothing_to_say_of_attackers(clean, tmp_path, capsys):
    print_report(evaluate(clean, [], tmp_path / "report", detector="place_drive:PlaceDetector"))
    assert SHORT_WHITE_BOX not in text_of(capsys.readouterr().out)
