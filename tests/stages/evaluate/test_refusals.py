"""Stage 3 refuses what it cannot score, in one line, and leaves nothing behind."""

import numpy as np
import pytest
from place_drive import DETECTOR, FRAMES, clean_cloud, hide_first_car, write_bag
from scored import evaluate

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.stages.evaluate import run
from advpipe.stages.evaluate.detection.scoring import CachedDetector


def refused(tmp_path, match, *args, **kwargs):
    with pytest.raises(AdvpipeError, match=match) as caught:
        evaluate(*args, tmp_path / "report", **({"detector": DETECTOR} | kwargs))
    assert "\n" not in str(caught.value)
    assert not [p for p in tmp_path.iterdir() if "report" in p.name]


class Careless:
    """Finds what `Detections` does not allow."""

    classes, range_m = ("car",), Range(-50, -50, -3, 50, 50, 3)
    boxes, scores, labels = np.zeros((1, 7)), np.ones(1), np.zeros(1, np.int64)

    def detect(self, cloud):
        return Detections(self.boxes, self.scores, self.labels)

    def loss(self, points, boxes, labels):
        raise AssertionError("nobody asks for this here")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"boxes": np.zeros((1, 8))}, r"shapes \(\(1, 8\), \(1,\), \(1,\)\)"),
        ({"labels": np.zeros(2, np.int64)}, "shapes"),
        ({"boxes": np.full((1, 7), np.nan)}, "not finite"),
        ({"labels": np.ones(1, np.int64)}, "labels beyond its 1 classes"),
    ],
)
def test_how_a_detector_errs_is_reported(monkeypatch, wrong, message):
    for name, value in wrong.items():
        monkeypatch.setattr(Careless, name, value)
    with pytest.raises(AdvpipeError, match=f"Careless.detect gave .*{message}"):
        CachedDetector(Careless()).detect(clean_cloud(0))


@pytest.mark.parametrize("mistake", [ZeroDivisionError("by\nzero"), SystemExit(0)])
def test_where_a_detector_breaks_down_is_reported(monkeypatch, mistake):
    def detect(self, cloud):
        raise mistake

    monkeypatch.setattr(Careless, "detect", detect)
    line = r"test_refusals:Careless failed: .* \(test_refusals.py, line "
    with pytest.raises(AdvpipeError, match=line) as stated:
        CachedDetector(Careless()).detect(clean_cloud(0))
    assert "\n" not in str(stated.value)


def test_bag_without_clouds_is_refused(tmp_path):
    with BagWriter(tmp_path / "no_clouds", provenance={}) as bag:
        bag.write(CLOCK, build.clock(1), 1)
    refused(tmp_path, "holds no LiDAR clouds", tmp_path / "no_clouds", [])


def test_bag_without_ground_truth_is_refused(tmp_path):
    bag = write_bag(tmp_path / "no_truth", {}, {0: clean_cloud(0)}, truth=False)
    refused(tmp_path, "has no ground truth", bag, [])


def test_bag_without_an_object_to_evaluate_is_refused(tmp_path):
    bag = write_bag(tmp_path / "hollow", {}, {0: clean_cloud(0)[300:]})
    refused(tmp_path, "no object of a class that the detector finds", bag, [])


def test_adversarial_bag_of_another_parent_is_refused(clean, attacked, tmp_path):
    other = attacked(hide_first_car, frames=range(2), parent_sha256="0" * 64)
    refused(tmp_path, "made from another bag", clean, [other])


def test_adversarial_bag_of_a_drive_that_was_recorded_anew_is_refused(clean, attacked, tmp_path):
    old = attacked(hide_first_car, frames=range(2), parent_sha256="0" * 64)
    refused(tmp_path, "attack again with overwrite=True or remove that folder", clean, [old])


def test_adversarial_bag_in_place_of_the_clean_one_is_refused(attacked, tmp_path):
    bag = attacked(hide_first_car, frames=range(2))
    refused(tmp_path, "is an adversarial bag; give the clean bag that it was made from first", bag, [])


def test_adversarial_frames_that_the_clean_bag_lacks_are_refused(clean, tmp_path):
    foreign = write_bag(tmp_path / "foreign", {}, {FRAMES + 3: clean_cloud(0)})
    refused(tmp_path, "give the clean bag that was attacked", clean, [foreign])


def test_unknown_detector_is_refused(clean, tmp_path):
    refused(tmp_path, "unknown detector 'huge'", clean, [], detector="huge")


def test_missing_bag_is_refused(clean, tmp_path):
    refused(tmp_path, "does not exist", clean, [tmp_path / "nowhere"])


def test_two_bags_of_one_name_are_refused(clean, attacked, tmp_path):
    bag = attacked(hide_first_car, frames=range(2))
    refused(tmp_path, "two adversarial bags are named attacked", clean, [bag, bag])


def test_unknown_defence_is_refused(clean, tmp_path):
    refused(tmp_path, "unknown defence 'pray'; known: sample", clean, [], defences=["pray"])


def test_two_detectors_of_one_name_are_refused(clean, tmp_path):
    refused(tmp_path, "two detectors are named", clean, [], detector=[DETECTOR, DETECTOR])


def test_no_tries_are_refused(clean, tmp_path):
    refused(tmp_path, "baseline tries are 0", clean, [], baseline_tries=0)


def test_frames_that_there_are_not_are_refused(clean, attacked, tmp_path):
    refused(tmp_path, f"select none of the bag's {FRAMES} frames", clean, [], frames=FrameSlice(30, 40))
    bag = attacked(hide_first_car, frames=range(2))
    refused(tmp_path, "holds none of the frames 10:12:1", clean, [bag], frames=FrameSlice(10, 12))


def test_no_bag_is_hashed_to_refuse_what_can_be_refused_at_once(clean, attacked, tmp_path, monkeypatch):
    def hashed(bag):
        raise AssertionError(f"{bag} may be large, and is not asked for yet")

    bag = attacked(hide_first_car, frames=range(2))
    monkeypatch.setattr(run, "parent_sha256", hashed)
    refused(tmp_path, "unknown detector 'huge'", clean, [bag], detector="huge")
    refused(tmp_path, "is an adversarial bag", bag, [])
    refused(tmp_path, f"select none of the bag's {FRAMES} frames", clean, [bag], frames=FrameSlice(30, 40))
    (tmp_path / "report").mkdir()
    with pytest.raises(OutputExistsError):
        evaluate(clean, [bag], tmp_path / "report", detector=DETECTOR)
