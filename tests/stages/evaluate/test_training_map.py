"""The banner of a report on a map that the detector was trained on, and the reports that have none."""

import json

import map_detectors
import pytest
from place_drive import FRAMES, clean_cloud, write_bag
from scored import evaluate

from advpipe.stages.evaluate.run import print_report

BANNER = "Training map: the detector map_detectors:TrainedHere was trained on drives on this map."


pytestmark = pytest.mark.usefixtures("no_pictures")


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    clouds = {index: clean_cloud(index) for index in range(FRAMES)}
    about = {"kind": "clean", "map_sha256": map_detectors.MAP}
    return write_bag(tmp_path_factory.mktemp("mapped") / "clean", about, clouds)


def shown(report, folder, capsys):
    """The lines on the terminal, the page and the document."""
    print_report(report)
    printed = " ".join(capsys.readouterr().out.split())
    return printed, (folder / "report.html").read_text(), json.loads((folder / "report.json").read_text())


def test_a_banner_stands_before_everything_else(mapped, tmp_path, capsys):
    report = evaluate(mapped, [], tmp_path / "report", detector="map_detectors:TrainedHere")
    printed, page, document = shown(report, tmp_path / "report", capsys)
    assert printed.startswith(BANNER)
    body = page.partition("<body>")[2].strip()
    assert body.startswith('<p class="banner" role="alert">' + BANNER)
    assert document["warnings"] == list(report.warnings)
    assert document["warnings"][0].startswith(BANNER)
    assert document["provenance"]["detectors"][0]["is_training_map"] is True


def test_a_map_that_it_was_not_trained_on_needs_none(mapped, tmp_path, capsys):
    report = evaluate(mapped, [], tmp_path / "report", detector="map_detectors:TrainedElsewhere")
    printed, page, document = shown(report, tmp_path / "report", capsys)
    assert "raining map" not in printed + page.partition("<body>")[2].partition("<h2>How the")[0]
    assert document["warnings"] == []
    assert document["provenance"]["detectors"][0]["is_training_map"] is False


@pytest.mark.parametrize(
    ("detector", "is_mapped", "reason"),
    [
        ("place_drive:PlaceDetector", True, "the detector does not say which maps it was trained on"),
        (
            "map_detectors:TrainedSomewhere",
            True,
            "the detector does not know all maps that it was trained on",
        ),
        ("map_detectors:TrainedHere", False, "the clean bag names no map"),
    ],
)
def test_what_nobody_knows_is_said(mapped, clean, tmp_path, capsys, detector, is_mapped, reason):
    bag = mapped if is_mapped else clean
    printed, page, document = shown(
        evaluate(bag, [], tmp_path / "report", detector=detector), tmp_path / "report", capsys
    )
    assert printed.startswith(f"Training map unknown: {detector} may have been trained")
    assert reason in printed
    assert reason in page.partition("<h1>")[0]
    assert document["provenance"]["detectors"][0]["is_training_map"] is None


def test_each_of_several_detectors_is_named(mapped, tmp_path):
    names = ["map_detectors:TrainedElsewhere", "map_detectors:TrainedHere", "place_drive:PlaceDetector"]
    report = evaluate(mapped, [], tmp_path / "report", detector=names)
    first, second = report.warnings
    assert "TrainedHere was trained" in first
    assert "PlaceDetector may have" in second
