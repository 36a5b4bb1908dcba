"""Provenance that somebody wrote by hand: what is none of ours costs a line."""

import pytest

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.evaluate.detection.baseline import USUAL_LOOKS, looks_of
from advpipe.stages.evaluate.detection.comparison import Comparison, attack_parameters
from advpipe.stages.evaluate.provenance import topic_remark
from advpipe.stages.evaluate.v2x import detection


def test_nothing_told():
    assert looks_of({}) == USUAL_LOOKS
    assert attack_parameters({}) == detection.attack_parameters({}) == {}


def test_what_is_told():
    assert looks_of({"looks": "13"}) == 13
    assert attack_parameters({"parameters": '{"ratio": 0.01}'}) == {"ratio": 0.01}
    assert attack_parameters({"parameters": '[{"ratio": 0.01}]'}) == {}  # of a coordinated attack
    attacks = '[{"type": "cam-dos", "parameters": {"rate_hz": 20.0}, "victim": null}]'
    assert detection.attack_parameters({"attacks": attacks}) == {"cam-dos": {"rate_hz": 20.0}}


def test_what_is_none_of_ours():
    readers = {
        "looks": (looks_of, ("many", "0", "-1", "2.5", "null", "1000000000", "")),
        "parameters": (attack_parameters, ("{", "7", '"ratio"')),
        "attacks": (detection.attack_parameters, ("[", "[3]", '[{"type": "cam-dos"}]', "{}")),
        "lidar_topics": (
            lambda about: topic_remark(Comparison(None, about, ()), "/ego/lidar/points"),
            ("/ego/lidar/points", "[1]", "{}"),
        ),
    }
    for key, (read, texts) in readers.items():
        for text in texts:
            with pytest.raises(AdvpipeError, match=f"provenance of the adversarial bag has {key} '"):
                read({key: text})
