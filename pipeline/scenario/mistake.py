"""A mistake in a scenario: where it is, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence

Place = tuple[str, ...]
"""Keys, and numbers of list items, from the top of the file."""

Mistake = tuple[Place, str]
"""Where it is, and what is wrong; the place is () where the message names its keys."""


class SeveralMistakesError(ValueError):
    """Several mistakes that one check of a model has found."""

    def __init__(self, found: Sequence[Mistake]) -> None:
        super().__init__("; ".join(message for _, message in found))
        self.found = tuple(found)
