"""What an attack declares about itself in its bag, for `verify` and `evaluate`.

The attack's class may be a user's own, and is never loaded to read a bag. A declaration is untrusted:
`verify` checks it against the bag.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from advpipe.pipeline.core.document import Count, Document, Number, ShortText
from advpipe.pipeline.labels.cloud_quantity import CloudQuantity

Family = Literal["gnss", "v2x", "lidar", "radar", "camera"]

MOST_PARTS = 10_000
"""Parts of a mix, at most: as many as a list of names in a scenario file can hold."""
_MOST_BOUNDS = 100

Bounds = Annotated[dict[ShortText, tuple[Number, Number]], Field(max_length=_MOST_BOUNDS)]
"""Minimum and maximum of a quantity (`quantity`) of the attack's family in each changed cloud, fix or
message, by the name of the quantity."""


class Published(Document):
    """What other data sets call an attack, and what is published of it.

    veremi_2018, veremi_extension: its number in the data sets of van der Heijden et al. (SecureComm 2018) and
    Kamel et al. (IEEE ICC 2020). nextgen: its place among the 15 attacks of VeReMi NextGen. catch_f1: F1 of
    CaTCH in the documentation of that, urban traffic of low density.
    """

    veremi_2018: Count | None = None
    veremi_extension: Count | None = None
    nextgen: Count | None = None
    catch_f1: Number | None = None


class Terms(Document):
    """The limits of an attack with its parameters, or of a part of a mix.

    bounds: kept in each cloud, fix or message that it changes. every_message_matters: whether all messages of
    its attackers are false whatever their contents: from stations that do not exist or are impersonated, or
    superfluous. labelled_as_published: whether labels follow the published code of a data set instead of the
    rule of `pipeline/v2x/facilities/effect.py`. untrue: the claims that it falsifies in its attackers' own
    messages (`claims.Claim`); all other fields of a message that it changes or delays stay as they are.
    begins_true: whether the first messages of its attackers stay true, as they have no older ones to repeat.
    """

    bounds: Bounds = Field(default_factory=dict)
    every_message_matters: bool = False
    labelled_as_published: bool = False
    untrue: Annotated[tuple[ShortText, ...], Field(max_length=_MOST_BOUNDS)] = ()
    begins_true: bool = False
    published: Published = Published()


class DeclaredPart(Terms):
    """One of the attacks that attackers of a mix draw from."""

    name: ShortText


class Declaration(Terms):
    """An attack with its parameters.

    parts: of a mix, what each attacker draws one of, in the order of the draw. quantities: of an attack on
    clouds, those of its bounds that are its own: how to measure them. message_types: of an attack on
    messages, the types that it changes, such as `cpm` (`message_type.MESSAGE_TYPES`).
    """

    family: Family
    quantities: Annotated[tuple[CloudQuantity, ...], Field(max_length=_MOST_BOUNDS)] = ()
    parts: Annotated[tuple[DeclaredPart, ...], Field(max_length=MOST_PARTS)] = ()
    message_types: Annotated[tuple[ShortText, ...], Field(max_length=_MOST_BOUNDS)] = ("cam",)

    def part(self, name: str) -> DeclaredPart | None:
        """The part of this name; None if there is none."""
        return next((part for part in self.parts if part.name == name), None)

    def plain(self) -> dict[str, Any]:
        """The declaration as written into a bag: without values that are the defaults."""
        return self.model_dump(mode="json", exclude_defaults=True)
