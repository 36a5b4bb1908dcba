"""What somebody who mistyped a name may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from advpipe.pipeline.core.short_repr import shorten

ALIKE = 0.6
"""How alike two names are, by `difflib`'s ratio, where one may be meant by the other."""

_MOST_SUGGESTED = 3
_MOST_LISTED = 20
"""Beside a suggestion: a longer list would hide it."""


def known_names(name: object, known: Iterable[str], label: str = "known") -> str:
    """For the end of an error about an unknown name: what may be meant, and what is known.

    label: of what is known.

    >>> known_names("detahc", ["perturb", "detach"])
    "did you mean 'detach'? known: perturb, detach"
    """
    names = list(known)
    hint, listed = suggestion(name, names), f"{label}: {', '.join(names) or 'none'}"
    if not hint:
        return listed
    return f"{hint} {listed}" if len(names) <= _MOST_LISTED else hint


def suggestion(name: object, known: Iterable[str]) -> str:
    """`did you mean 'detach'?`; "" where no known name is like it.

    A name that is part of others, such as `speed` of `cam-speed-offset`, may mean any of these.
    """
    names, typed = list(known), shorten(str(name)).lower()
    lower = {each.lower(): each for each in reversed(names)}
    found = [lower[each] for each in difflib.get_close_matches(typed, lower, n=1, cutoff=ALIKE)]
    if not found and len(typed) > 2:
        found = [each for each in names if typed in each.lower()][:_MOST_SUGGESTED]
    return f"did you mean {' or '.join(map(repr, found))}?" if found else ""


def nearest_names(name: object, known: Iterable[str]) -> list[str]:
    """The three that are most like it, however little that is.

    >>> nearest_names("dtch", ["perturb", "detach", "attach", "cam-stop"])[:2]
    ['detach', 'attach']
    """
    return difflib.get_close_matches(shorten(str(name)).lower(), list(known), n=_MOST_SUGGESTED, cutoff=0)
