"""The README and docs/ against what they quote: committed reports, measured ingredients, and geometry."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.adversary.constraints import Constraints
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.metrics.average_precision import STRICT_IOU
from advpipe.pipeline.scenario import load_scenario

ROOT = Path(__file__).parents[2]
README, RESULTS, LIDAR_ATTACKS, EVALUATION, SCENARIOS, DETECTOR = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in (
        "README.md",
        "docs/results.md",
        "docs/lidar-attacks.md",
        "docs/evaluation.md",
        "docs/scenarios.md",
        "docs/detector.md",
    )
)
CAR_M = (4.5, 1.8, 1.6)
OFF_M = {"13 cm along all three axes": (0.13, 0.13, 0.13), "32 cm sideways": (0.0, 0.32, 0.0)} | {
    "80 cm lengthways": (0.8, 0.0, 0.0)
}


def paragraph(phrase: str, page: str = RESULTS) -> str:
    """The one paragraph of a page that holds these words."""
    (found,) = [text for text in page.split("\n\n") if phrase in text]
    return found


def rows(report: str) -> dict[str, dict[str, object]]:
    """By recipe and cell."""
    document = json.loads((ROOT / "datasets" / "reports" / report / "report.json").read_text())
    return {
        f"{each['recipe']}-{each['cell']}": each["row"]
        for each in document["cells"]
        if each["status"] == "done"
    }


def overlap(off_m: tuple[float, float, float]) -> float:
    """Of the mean car with a box of its own size that is off by so much."""
    car = np.array([[0.0, 0.0, 0.0, *CAR_M, 0.0]])
    return float(iou_3d(car, car + np.array([[*off_m, 0.0, 0.0, 0.0, 0.0]]))[0, 0])


@pytest.mark.parametrize("phrase", OFF_M)
def test_how_far_off_a_box_is_a_miss(phrase: str) -> None:
    """To the centimetre, or to the 2 cm in the length; wherever the three ways stand."""
    off_m = np.array(OFF_M[phrase])
    more, less = (overlap(tuple(off_m + sign * 0.02 * (off_m > 0))) for sign in (1, -1))
    assert more < STRICT_IOU["car"] < less
    length, axis = phrase.split(" cm ")[0], phrase.split()[2]
    texts = paragraph("our mean car (4.5 × 1.8 × 1.6 m)"), paragraph("mean car (4.5 ×", EVALUATION)
    for place in (*texts, " ".join((Constraints.__doc__ or "").split())):
        assert re.search(rf"{length} cm {axis}", place), (phrase, place)


def test_random_best_stands_beside_the_tables() -> None:
    about = json.loads((ROOT / "pipeline" / "campaigns" / "sweep" / "ingredients.json").read_text())
    lines = {
        attack: {line["line"]: line["map_ratio_plain_percent"] for line in about[attack]["lines"]}
        for attack in ("perturb", "detach", "attach")
    }
    text = paragraph("`random-best`, which has the same choice among blind tries")
    for of_attack in lines.values():
        assert f"{of_attack['recipe random-best']:.1f} %" in text
        assert f"{of_attack['recipe best']:.1f}" in text


def test_recipe_paper_is_said_to_hold_its_points() -> None:
    rms_mm = 1000 * float(str(rows("town06-budgets")["paper-perturb-10"]["rms_displacement_m"]))
    (line,) = [line for line in RESULTS.splitlines() if line.startswith("| recipe `paper`, λ = 0.01")]
    assert f"held to {rms_mm:.1f} mm" in line
    assert f"{rms_mm:.1f} mm (RMS) of the 100 mm allowed" in RESULTS


def test_the_attacker_is_said_to_know_the_truth() -> None:
    for text in (paragraph("white box", LIDAR_ATTACKS), paragraph("The attacker knows", README)):
        assert "true boxes" in text
        assert "matches detections" in text


@pytest.mark.parametrize(("text", "key"), [("name: x", "map"), ("map: {generator: {}}", "name")])
def test_what_a_scenario_has_to_give(tmp_path: Path, text: str, key: str) -> None:
    assert all("`name` and `map` have to be given" in page for page in (README, SCENARIOS))
    (tmp_path / "all.yaml").write_text("name: x\nmap: {generator: {}}")
    (tmp_path / "part.yaml").write_text(text)
    load_scenario(str(tmp_path / "all.yaml"))
    with pytest.raises(AdvpipeError, match=rf"{key}: "):
        load_scenario(str(tmp_path / "part.yaml"))


def test_scenarios_on_training_maps_are_named() -> None:
    """Those, and only those, whose map is the boulevard or the highway."""
    for page in (README, SCENARIOS):
        text = paragraph("are on maps that it was trained on", page)
        for path in (ROOT / "scenarios").glob("*.yaml"):
            is_trained = re.search(r"sumo_net: (boulevard|highway)", path.read_text()) is not None
            assert (f"`{path.stem}`" in text.partition("The scenarios")[2]) == is_trained, path.stem


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 150
