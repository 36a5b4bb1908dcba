"""Report texts: numbers as people read them, JSON that every reader takes."""

import pytest

from advpipe.pipeline.results.evaluation import plain_value
from advpipe.stages.evaluate.detection.summary import classes_in_map
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.table import changed_percent, interval


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(0.12345, 3, "0.123"), (1234, 0, "1,234"), (None, 2, "–"), (float("nan"), 2, "–"), (65.0, 2, "65.00")],
)
def test_numbers(value, digits, text):
    assert formatted_number(value, digits) == text


def test_intervals():
    assert interval((40.12, 52.37)) == "40.1…52.4"
    assert interval(None) == "–"


def test_changed_points():
    assert changed_percent(removed=10, added=0, moved=5, clean=1000) == "−1.00 % ~0.50 %"
    assert changed_percent(0, 0, 0, 1000) == changed_percent(1, 2, 3, 0) == "–"


def test_classes_of_the_map():
    assert classes_in_map({"car": 50, "truck": 49, "cyclist": 0}) == (["car"], [])
    chosen, notes = classes_in_map({"car": 10, "truck": 0, "pedestrian": 3})
    assert chosen == ["car", "pedestrian"]
    assert notes == [
        "No class has 50 evaluated boxes: mAP over those with any, each with equal weight "
        "(car 10, pedestrian 3)."
    ]


def test_json_has_no_nan():
    assert plain_value({"b": float("nan"), "a": (1 / 3, float("inf"))}) == {
        "a": [0.33333333, None],
        "b": None,
    }
