"""The first screen: what was done, how bad it is, and the values of report.json on cards."""

import json
import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from place_drive import DETECTOR, FRAMES, hide_first_car

from advpipe.stages.evaluate.report.headline import first_screen
from advpipe.stages.evaluate.report.headline_parts import BAD, GOOD, meant_by_more, meant_by_share
from advpipe.stages.evaluate.report.wording import v2x_deed
from advpipe.stages.evaluate.run import Options, evaluate

pytestmark = pytest.mark.usefixtures("no_pictures")


def effects_of(folder):
    return json.loads((folder / "report.json").read_text())["attack_effects"]


def test_an_attack_on_all_frames(clean, attacked, tmp_path):
    options = Options(detectors=(DETECTOR,), scene=False)
    report = evaluate(clean, [attacked(hide_first_car, frames=range(6))], tmp_path / "r", options, workers=1)
    first = first_screen(report)
    assert "of the LiDAR points removed" in first.title
    assert "6 frames with 24 evaluated objects" in first.about
    (headline,) = first.headlines
    attack, *baselines = effects_of(tmp_path / "r")
    assert {each["frames"] for each in (attack, *baselines)} == {"all"}
    assert (attack["lost_objects"], attack["found_clean"], attack["displaced_objects"]) == (6, 24, 0)
    strict, loose, lost = headline.cards
    assert strict.value == f"{attack['map_ratio_percent']:.1f} %"
    assert loose.value == f"{attack['map_loose_ratio_percent']:.1f} %"
    assert lost.value == "25.0 %"
    assert strict.meant == lost.meant == BAD
    assert lost.meaning.startswith("6 of 24 found objects")
    assert [card.interval for card in headline.cards] == ["no interval: 6 frames"] * 3
    assert strict.attacked == ""
    strongest = min(each["map_ratio_percent"] for each in baselines)
    assert strict.beside.endswith(f": {strongest:.1f} %")
    assert headline.verdict.startswith("Removing ")
    assert headline.does.startswith("removes ")
    assert "; the same budget spent at random, best of " in headline.verdict
    assert (
        f"leaves the detector {strict.value} of its average precision at strict overlap" in headline.verdict
    )


def test_an_attack_on_some_frames_has_the_values_of_these_beside(clean, attacked, tmp_path):
    changed = iter([True, True] + [False] * 4)
    bag = attacked(lambda cloud: hide_first_car(cloud) if next(changed) else cloud, frames=range(6))
    options = Options(detectors=(DETECTOR,), scene=False, baseline=False)
    report = evaluate(clean, [bag], tmp_path / "r", options, workers=1)
    every, alone = effects_of(tmp_path / "r")
    assert (every["frames"], every["frame_count"], every["lost_percent"]) == (
        "all",
        6,
        pytest.approx(100 / 12),
    )
    assert (alone["frames"], alone["frame_count"], alone["lost_percent"]) == ("attacked", 2, 25.0)
    assert alone["map_ratio_percent"] < every["map_ratio_percent"]
    assert first_screen(report).headlines[0].cards[2].attacked == "over the 2 attacked frames alone: 25.0 %"


def test_of_several_detectors_the_first_is_named(clean, attacked, tmp_path):
    six = range(6)
    bags = [
        attacked(hide_first_car, frames=six),
        attacked(lambda cloud: cloud[30:], name="other", frames=six),
    ]
    options = Options(detectors=(DETECTOR, "place_drive:KeenDetector"), scene=False, baseline=False)
    (headline,) = first_screen(evaluate(clean, bags, tmp_path / "r", options, workers=1)).headlines
    assert headline.verdict.startswith("The strongest of 2 attacks: removing ")
    assert " leaves the detector PlaceDetector " in headline.verdict
    assert headline.shown.endswith(" on detector PlaceDetector, the strongest of 2 attacks")
    assert len(headline.table.lines) == 4
    (headline,) = first_screen(evaluate(clean, bags[:1], tmp_path / "one", options, workers=1)).headlines
    assert headline.verdict.startswith("Removing ")
    assert headline.shown.endswith(" on detector PlaceDetector")
    (headline,) = first_screen(evaluate(clean, [], tmp_path / "clean", options, workers=1)).headlines
    assert headline.verdict.startswith("The detector PlaceDetector finds ")


def test_a_clean_bag_alone(clean, tmp_path):
    report = evaluate(clean, [], tmp_path / "r", Options(detectors=(DETECTOR,), scene=False), workers=1)
    first = first_screen(report)
    assert first.title.startswith("What detector ")
    assert "adversarial" not in first.about
    (headline,) = first.headlines
    assert [card.title for card in headline.cards] == ["mAP, strict", "mAP, loose", "Objects found"]
    assert f"{4 * FRAMES} of {4 * FRAMES}" in headline.verdict


def test_the_verdict_says_what_an_attack_on_messages_does():
    assert v2x_deed("cam-sybil-congestion+gnss-relocate").startswith("announces ghost vehicles")
    assert v2x_deed("cam-dos-random-sybil") == "floods the radio channel with V2X messages"
    assert v2x_deed("cam-position-offset") == "announces false positions in V2X messages"
    assert v2x_deed("mine") == "sends false V2X messages"


def test_a_value_is_red_where_it_is_bad_and_green_where_it_is_good():
    assert [meant_by_share(share) for share in (1.0, 0.7, 0.0, math.nan)] == [GOOD, "", BAD, ""]
    assert [meant_by_more(attacked, 1.5) for attacked in (1.6, 57.0, math.nan)] == ["", BAD, ""]
    assert meant_by_more(0.0, 0.0) == ""
