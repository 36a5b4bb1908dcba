"""What `report.json` lists as `security`, `privacy` and `denm`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class ReasonCount:
    """How many messages receivers rejected for one reason."""

    reason: Annotated[str, "why, such as `unsigned` or `wrong signature`"]
    messages: Annotated[int, "number of messages"]


@dataclass(frozen=True)
class SecurityRecord(Listed):
    """What receivers that verify signatures made of the messages of one attack, or of all that none touched,
    over all instrumented vehicles of a bag."""

    bag: Annotated[str, "adversarial bag, or `clean`"]
    attack: Annotated[str, "name of the attack; empty for the messages that none touched"]
    attacker: Annotated[str, "`insider`, with valid tickets, or `outsider`; empty without an attack"]
    credentials: Annotated[str, "what the attackers sign with; empty without an attack"]
    received: Annotated[int, "number of its messages that reached radios"]
    accepted: Annotated[int, "number of them that were verified, and reached the facilities"]
    stopped: Annotated[float, "share of them that security rejected, in [0, 1]"]
    rejected: Annotated[tuple[ReasonCount, ...], "the rejected ones by reason, the most frequent first"]


@dataclass(frozen=True)
class DensityRecord:
    """The tracker's success where this many others were near."""

    neighbours_min: Annotated[int, "least number of other stations within 100 m when the pseudonym changed"]
    neighbours_max: Annotated[int, "largest number; -1 for any"]
    changes: Annotated[int, "number of changes"]
    linked: Annotated[int, "number of them that the tracker followed rightly"]


@dataclass(frozen=True)
class PrivacyRecord(Listed):
    """How well a simple tracker that hears every CAM of a drive follows stations through the changes of their
    pseudonyms."""

    bag: Annotated[str, "clean bag"]
    strategy: Annotated[str, "by which stations change their pseudonyms"]
    stations: Annotated[int, "number of stations that sent CAMs"]
    changes: Annotated[int, "number of changes after which the new pseudonym was used"]
    linked: Annotated[int, "number of changes that the tracker followed to the right pseudonym"]
    mislinked: Annotated[int, "number of new pseudonyms that it took for another station's"]
    success: Annotated[float, "share of the changes that it followed rightly, in [0, 1]"]
    tracked: Annotated[float, "share of its time on the road for which it follows a station at a stretch"]
    neighbours: Annotated[float, "mean number of other stations within 100 m when a pseudonym changed"]
    by_density: Annotated[tuple[DensityRecord, ...], "the same by the number of other stations nearby"]


@dataclass(frozen=True)
class DenmRecord(Listed):
    """The warnings (DENMs) that one vehicle received, and how well two simple checks find false ones."""

    bag: Annotated[str, "adversarial bag, or `clean`"]
    vehicle: Annotated[str, "receiving vehicle"]
    messages: Annotated[int, "number of DENMs that it received"]
    false_messages: Annotated[int, "number of them that an attack sent"]
    events: Annotated[int, "number of true events that stations within 500 m announced"]
    known: Annotated[int, "number of those of which it learned"]
    false_events: Annotated[int, "number of events that do not exist of which it was warned"]
    suppressed: Annotated[int, "number of true events that an attack ended for it while they lasted"]
    recall: Annotated[float, "share of false messages that a check flags, in [0, 1]"]
    false_positive_rate: Annotated[float, "share of honest DENMs that a check flags, in [0, 1]"]
