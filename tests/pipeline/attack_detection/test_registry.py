"""Attack checks by name, and users' own."""

import numpy as np
import pytest
from rotating import NOTHING, knowledge, turn

from advpipe.pipeline.attack_detection.names import BOX_CHECKS, POINT_CHECKS, SEQUENCE_CHECKS
from advpipe.pipeline.attack_detection.registry import (
    ATTACK_CHECKS,
    chosen_sequence_checks,
    parse_attack_checks,
)
from advpipe.pipeline.core.errors import AdvpipeError, UsageError


def test_names():
    assert (*POINT_CHECKS, *BOX_CHECKS) == tuple(ATTACK_CHECKS)
    assert list(parse_attack_checks(["ray", "density"])) == ["ray", "density"]
    assert list(parse_attack_checks(["all"])) == list(ATTACK_CHECKS)
    assert parse_attack_checks(["none"]) == {}
    assert list(parse_attack_checks(["temporal", "ray"])) == ["ray"]
    assert chosen_sequence_checks(["ray", "temporal"]) == chosen_sequence_checks(["all"]) == SEQUENCE_CHECKS
    assert chosen_sequence_checks(["ray"]) == ()


@pytest.mark.parametrize(
    ("names", "error"),
    [
        (["rays"], "unknown attack check 'rays'.*ray"),
        (["ray", "ray"], "given twice"),
        (["all", "temporal"], "temporal is given twice"),
        (["none", "ray"], "stands alone"),
        (["nowhere:Class"], "cannot be loaded"),
    ],
)
def test_wrong_names_are_refused(names, error):
    with pytest.raises(UsageError, match=error):
        parse_attack_checks(names)


def test_a_check_of_ones_own():
    make = parse_attack_checks(["own_attack_checks:Bright"])["own_attack_checks:Bright"]
    cloud = turn(1)
    cloud["intensity"][4] = 1
    found = make(knowledge())(cloud, NOTHING)
    assert (found.score, np.flatnonzero(found.points).tolist()) == (1, [4])


def test_a_wrong_answer_of_ones_own_check_is_one_line():
    make = parse_attack_checks(["own_attack_checks:Wrong"])["own_attack_checks:Wrong"]
    with pytest.raises(AdvpipeError, match=r"own_attack_checks:Wrong failed.*points has the shape"):
        make(knowledge())(turn(1), NOTHING)
