"""The catalogue against the classes, and against what verify measures of the bags that attacks make."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.base import Attack
from advpipe.stages.attack.catalogue import catalogue, catalogue_entry
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer
from advpipe.stages.attack.registry import ATTACKS


class North(GnssAttack):
    """Reports a place too far north.

    offset_m: by how much.
    """

    traits = GnssTraits(also_known_as=("up",))

    def __init__(self, *, offset_m: float) -> None:
        self.offset_m = offset_m

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {"fix_displacement_m": (self.offset_m, self.offset_m)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        return lambda context: context.position_m + np.array([0.0, self.offset_m, 0.0])


def test_every_attack_is_in_it_once_and_families_stay_together() -> None:
    entries = catalogue()
    assert {entry.name for entry in entries} == set(ATTACKS)
    assert len(entries) == len(ATTACKS)
    families = [entry.family for entry in entries]
    changes = [one for one, before in zip(families, [None, *families], strict=False) if one != before]
    assert sorted(changes) == sorted(set(families))


def test_every_attack_says_in_a_sentence_what_it_does() -> None:
    for entry in catalogue():
        assert 20 < len(entry.headline) <= 250, entry.name
        assert entry.headline.endswith(".")
        assert entry.summary.startswith(entry.headline.removesuffix("."))


def test_budget_and_bounds_are_those_of_the_defaults() -> None:
    detach = catalogue_entry("detach")
    assert (detach.budget, detach.budget_title) == ("ratio", "Detachment, share removed in %")
    assert {one.name: one.default for one in detach.parameters}["ratio"] == 0.01
    assert [str(one) for one in detach.bounds if one.quantity == "share_removed"] == ["0 to 0.01"]
    assert detach.recipe.startswith('"best" empties the voxels')
    late = catalogue_entry("cam-delay")
    assert [str(one) for one in late.bounds] == ["2 to 4 s"]
    assert (late.budget, late.recipe) == ("", "")
    assert "speed" in catalogue_entry("cam-speed-offset").untrue


def test_a_papers_name_finds_the_attack() -> None:
    assert catalogue_entry("PAA") == catalogue_entry("gnss-relocate")


def test_an_attack_of_ones_own_needs_its_parameter_first() -> None:
    entry = catalogue_entry(f"{__name__}:North")
    assert (entry.family, entry.headline) == ("gnss", "Reports a place too far north.")
    assert entry.bounds == ()  # nobody knows them before offset_m is given
    (offset,) = entry.plain()["parameters"]
    assert offset == {
        "name": "offset_m",
        "types": ["float"],
        "is_required": True,
        "default": None,
        "help": "by how much.",
    }


@pytest.mark.parametrize("word", ["explode", "nowhere:Attack", f"{__name__}:catalogue"])
def test_what_is_no_attack_is_refused(word: str) -> None:
    with pytest.raises(AdvpipeError, match="attack"):
        catalogue_entry(word)


def test_plain_is_json() -> None:
    for entry in catalogue():
        assert json.loads(json.dumps(entry.plain()))["name"] == entry.name
    assert issubclass(North, Attack)


def test_texts_hold_no_names_of_classes() -> None:
    """Users know attacks by the names that they type."""
    for entry in catalogue():
        texts = (entry.summary, entry.recipe, *(one.help for one in entry.parameters))
        assert not any(re.search(r"`[A-Z][a-z]+[A-Z]\w*`", text) for text in texts), entry.name
