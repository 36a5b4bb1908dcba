"""How well checks tell attacked clouds: rates worked out by hand, and the section of a report."""

import json
import math
from functools import partial

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from place_drive import DETECTOR, FRAMES, PLACES
from scored import document, unwrapped
from scored import evaluate as evaluate_with

from advpipe.pipeline.attack_detection.base import CheckNotApplicableError, Suspicion, worst
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.results.schema import report_schema
from advpipe.stages.evaluate.detection.attack_detection import cross_thresholds
from advpipe.stages.evaluate.run import print_report

evaluate = partial(evaluate_with, detector=DETECTOR, baseline=False, scene=False)

pytestmark = pytest.mark.usefixtures("no_pictures")

AHEAD = PLACES[:1] + np.array([[6.0, 0, 0, 0, 0, 0, 0]])
"""Where the attack puts the first car."""


def move_first_car(cloud):
    """The 60 points of place 0 go 6 m ahead."""
    cloud["x"][:60] += np.float32(6.0)
    return cloud


class Ahead:
    """Counts points 6 m before the first car, where the clean drive has nothing but ground."""

    def __init__(self, knowledge):
        assert len(knowledge.clean) == 9  # two frames apart

    def __call__(self, cloud, detections):
        points = np.zeros(len(cloud), bool)
        points[points_in_boxes(xyz(cloud), AHEAD)[0]] = True
        return Suspicion(float(points.sum()), points=points)


class Boxes:
    """Suspects each detection by its number of points, and takes those of more than 45 for spoofed."""

    def __init__(self, knowledge):
        pass

    def __call__(self, cloud, detections):
        return worst(100 * detections.scores, detections.scores > 0.45)


class Impossible:
    def __init__(self, knowledge):
        raise CheckNotApplicableError("the moon is not full")


def test_each_half_is_judged_by_the_other():
    thresholds, calibration = cross_thresholds(np.array([1.0, 2, 3, 7, 5, 6]))
    assert (thresholds.tolist(), calibration) == ([7, 7, 7, 3, 3, 3], 3)
    thresholds, calibration = cross_thresholds(np.array([1.0, 2, 3]))
    assert (thresholds.tolist(), calibration) == ([3, 3, 2], 1)


def test_nothing_exceeds_the_threshold_of_a_single_cloud():
    thresholds, calibration = cross_thresholds(np.array([1.0]))
    assert (thresholds.tolist(), calibration) == ([math.inf], 0)


@pytest.fixture(scope="module")
def report_of(attacked_once, clean, tmp_path_factory):
    """An attack on every third frame, under checks of this module, and those that need rings."""
    bag = attacked_once(
        lambda cloud: move_first_car(cloud), parameters=json.dumps({"eps_cm": 600}), attack="perturb"
    )
    out = tmp_path_factory.mktemp("reports") / "report"
    names = [f"test_attack_detection:{name}" for name in ("Ahead", "Boxes", "Impossible")]
    return out, evaluate(clean, [bag], out, detect_attacks=(*names, "ray"), baseline_tries=None)


def records(out):
    return {each["check"].partition(":")[2]: each for each in document(out)["attack_detection"]}


def test_rates_of_a_check_that_judges_points(report_of):
    found = records(report_of[0])["Ahead"]
    assert (found["frames"], found["attacked_frames"], found["calibration_frames"]) == (FRAMES, FRAMES, 9)
    assert (found["true_positive_percent"], found["auc"]) == (100, 1)
    assert found["expected_false_positive_percent"] == 10
    assert found["points_true_positive_percent"] > 80  # some lie outside of the box
    assert found["points_false_positive_percent"] < 1
    assert found["new_detections_true_positive_percent"] is None
    assert found["detections_called_fake_percent"] is None


def test_rates_of_a_check_that_judges_detections(report_of):
    """The first car has 60 points, the other objects 50, 40 and 30; it is gone from the attacked clouds."""
    found = records(report_of[0])["Boxes"]
    assert (found["true_positive_percent"], found["false_positive_percent"], found["auc"]) == (0, 0, 0)
    assert (found["new_detections"], found["new_detections_true_positive_percent"]) == (0, None)
    assert found["detections_false_positive_percent"] == 0
    assert found["detections_called_fake_percent"] == 50  # two of four
    assert found["new_detections_called_fake_percent"] is None
    assert found["points_true_positive_percent"] is None


def test_checks_that_cannot_run_are_named(report_of):
    out, _ = report_of
    page = (out / "report.html").read_text()
    assert set(records(out)) == {"Ahead", "Boxes"}
    assert "Check test_attack_detection:Impossible did not run: the moon is not full." in page
    assert "Check ray did not run: the clouds do not say of which ring their points are." in page
    assert document(out)["provenance"]["attack_checks"][-1] == "ray"


def test_report_and_schema(report_of, capsys):
    out, report = report_of
    assert list(Draft202012Validator(report_schema()).iter_errors(document(out))) == []
    assert "calibrated on 9 clean clouds" in (out / "report.html").read_text()
    print_report(report)
    assert "Attack detection" in unwrapped(capsys)


def test_without_checks_there_is_no_section(attacked, clean, tmp_path):
    evaluate(clean, [attacked(move_first_car)], tmp_path / "report", detect_attacks=("none",))
    assert "attack_detection" not in document(tmp_path / "report")


def test_a_drive_without_a_run_of_consecutive_clouds_is_told_how_to_get_one(attacked_once, clean, tmp_path):
    bag = attacked_once(move_first_car, "moved", parameters=json.dumps({"eps_cm": 600}), attack="perturb")
    evaluate(clean, [bag], tmp_path / "report", detect_attacks=("temporal",))
    found = document(tmp_path / "report")
    assert "attack_detection" not in found
    assert found["provenance"]["attack_checks"] == ["temporal"]
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Check temporal did not run: it takes 30 consecutive attacked clouds" in page
