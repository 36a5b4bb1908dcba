"""The misbehaviour detectors by name; a user's own is named `module:Class`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.plugins import plugin_errors
from advpipe.pipeline.misbehaviour.catch import (
    BOUNDED_CATCH,
    F1_CATCH,
    PUBLISHED_CATCH,
    CatchDetector,
)
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.detector import PlausibilityDetector
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector, Verdicts, refuse_wrong_verdicts

OURS, BASELINE = "advpipe", "catch"

MISBEHAVIOUR_DETECTORS: Mapping[str, MisbehaviourDetector] = MappingProxyType(
    {
        OURS: PlausibilityDetector(),
        BASELINE: CatchDetector(BOUNDED_CATCH),
        "catch-f1": CatchDetector(F1_CATCH),
        "catch-published": CatchDetector(next(iter(PUBLISHED_CATCH.values()))),
    }
)
"""Our own; and CaTCH's checks tuned with the same bound on false positives, tuned for F1 alone, and with the
parameters that NextGen published with its F1."""


def misbehaviour_detectors(own: Sequence[str] = ()) -> dict[str, MisbehaviourDetector]:
    """The detectors of advpipe by name, then those of a user, by `module:Class`.

    Raises UsageError for a name of another form, a class that cannot be loaded or made, and a name that is
    given twice.
    """
    found = dict(MISBEHAVIOUR_DETECTORS)
    for name in own:
        if name in found:
            raise UsageError(f"misbehaviour detector {name} is there already; leave it out")
        found[name] = _UsersDetector(name)
    return found


class _UsersDetector:
    """A user's detector, whose mistakes become one-line errors."""

    def __init__(self, name: str) -> None:
        if ":" not in name:
            raise UsageError(f"misbehaviour detector {name!r} is unknown; name your own as module:Class")
        own_class: Any = import_object(name, f"misbehaviour detector {name} cannot be loaded")
        if not callable(getattr(own_class, "judge", None)):
            raise UsageError(f"misbehaviour detector {name} has no method judge")
        self._name = name
        with plugin_errors([name]):
            self._detector: MisbehaviourDetector = own_class()

    def judge(self, claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> Verdicts:
        with plugin_errors([self._name]):
            found = self._detector.judge(claims, receivers)
            refuse_wrong_verdicts(found, len(claims))
        return found
