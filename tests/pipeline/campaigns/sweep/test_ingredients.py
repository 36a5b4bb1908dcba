"""What each ingredient brings, beside cells of the detector that it was measured on."""

import json

from advpipe.pipeline.campaigns.sweep import ingredients
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
from advpipe.pipeline.campaigns.sweep.ingredients import ingredients_tables, measured

MEASURED_SHA256 = json.loads(ingredients.PATH.read_text())["detach"]["detector_sha256"]


def of_detector(sha256):
    settings = Settings("a" * 64, "small", sha256, "0::2", 0, 5, None, "0.1.0", "d" * 64)
    return Cell("detach-1", "best", settings, {}, "c" * 64, (0,), (3,), (1,), ())


def test_one_detector_was_measured():
    """Each attack, by the recipe itself first; that was the shipped detector of the version before."""
    shown = measured([of_detector(MEASURED_SHA256)])
    assert list(shown) == ["perturb", "detach", "attach"]
    for about in shown.values():
        assert about["lines"][0]["line"] == "recipe best"
        assert len({line["budget"] for line in about["lines"]}) == 1


def test_another_detector_was_not():
    assert measured([of_detector("b" * 64)]) == {}
    assert ingredients_tables([of_detector("b" * 64)]) == []


def test_a_line_for_each_ingredient(tmp_path, monkeypatch):
    line = {
        "line": "recipe best",
        "budget": 0.3,
        "map_ratio_plain_percent": 30.04,
        "map_ratio_loose_percent": 80.0,
        "map_ratio_jitter_percent": 55.5,
        "map_ratio_rounding_percent": 56.0,
        "car_ratio_percent": 20.0,
        "chamfer_distance_m2": 0.00123,
        "s_per_frame": 16.2,
    }
    about = {"detector_sha256": "b" * 64, "frame_list": [10, 28], "lines": [line]}
    monkeypatch.setattr(ingredients, "PATH", tmp_path / "ingredients.json")
    ingredients.PATH.write_text(json.dumps({"detach": about}))
    (table,) = ingredients_tables([of_detector("b" * 64)])
    assert table.title.endswith("detach, share removed in % 0.3, 2 frames of a validation drive")
    assert table.lines == (("recipe best", "30.0", "80.0", "55.5", "56.0", "20.0", "0.00123", "16"),)
