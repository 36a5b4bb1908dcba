"""F2MD's denial of service: the attacker's interval is divided, and all its messages are of the attack."""

from __future__ import annotations

import math
from collections.abc import Sequence

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.cams import with_fields
from advpipe.stages.attack.v2x.flood import extrapolated
from advpipe.stages.attack.v2x.overheard_messages import with_later_time
from advpipe.stages.attack.v2x.published.detected_nodes import DetectedNodes
from advpipe.stages.attack.v2x.published.own_rate import OwnRateFlood, as_own
from advpipe.stages.attack.v2x.published.veins import Playground

MULTIPLES, SYBIL_MULTIPLES = (2, 4), (2,)
"""The code rounds the factor 1 +- 55 % down to 0 or 1 before it multiplies, and takes 2 at least."""
SPEED_MPS, ACCELERATION_MPS2 = 40.0, 2.0


class F2mdDos(OwnRateFlood):
    """True messages at two or four times the own rate."""

    traits = V2xTraits(every_message_matters=True, published=Published(veremi_extension=13))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context, MULTIPLES)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        tree = self.context.cams.open(own.payload)
        return tree if tree is None or place == 0 else extrapolated(tree, at_ns - own.request_ns)


class F2mdDosRandom(OwnRateFlood):
    """Random places of the playground, velocities, accelerations and headings: two or four a message."""

    traits = V2xTraits(
        untrue=("position", "speed", "heading", "acceleration"),
        every_message_matters=True,
        published=Published(veremi_extension=14),
    )

    def __init__(self, context: AttackContext, multiples: Sequence[int] = MULTIPLES) -> None:
        super().__init__(context, multiples)
        self._playground = Playground(context)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        self._playground.set_from(step)
        return super().edit(step, sent)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        tree = self.context.cams.open(own.payload)
        if tree is None:
            return None
        rng = self.rngs[own.station_id]
        x_m, y_m = self._playground.draw(rng)
        latitude_deg, longitude_deg, _ = self.context.geodesy.to_geographic([x_m, y_m, 0.0]).tolist()
        east, south = rng.uniform(-1, 1, 2).tolist()
        return with_fields(
            with_later_time(tree, at_ns - own.request_ns),
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            speed_mps=math.hypot(*rng.uniform(0, SPEED_MPS, 2).tolist()),
            longitudinal_acceleration_mps2=math.hypot(*rng.uniform(0, ACCELERATION_MPS2, 2).tolist()),
            heading_rad=math.atan2(east, -south) % math.tau,
        )


class F2mdDosDisruptive(OwnRateFlood):
    """Random messages of random stations, as own ones, at two or four times the own rate."""

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time")),
        every_message_matters=True,
        published=Published(veremi_extension=15),
    )

    def __init__(self, context: AttackContext, multiples: Sequence[int] = MULTIPLES) -> None:
        super().__init__(context, multiples)
        self._nodes = DetectedNodes(context)

    def remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        self._nodes.listen(step, sent)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        found = self._nodes.random(own.station_id, at_ns, self.rngs[own.station_id])
        tree = None if found is None else self.context.cams.open(found.payload)
        own_tree = self.context.cams.open(own.payload)
        if tree is None or own_tree is None:
            return None
        return as_own(tree, own_tree, at_ns - own.request_ns)


class _NewPseudonyms(OwnRateFlood):
    """A new pseudonym for each message."""

    _pseudonyms = 0

    def renamed(self, own: Sent, tree: CamTree | None) -> CamTree | None:
        if tree is None:
            return None
        self._pseudonyms += 1
        pseudonym = self.context.pseudonym("flood", own.station_id, self._pseudonyms)
        return with_fields(tree, station_id=pseudonym)


class F2mdDosRandomSybil(_NewPseudonyms, F2mdDosRandom):
    """Random messages at twice the own rate, each with a new pseudonym."""

    traits = V2xTraits(
        untrue=("station id", *F2mdDosRandom.traits.untrue),
        every_message_matters=True,
        published=Published(veremi_extension=18),
    )

    def __init__(self, context: AttackContext) -> None:
        F2mdDosRandom.__init__(self, context, SYBIL_MULTIPLES)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        return self.renamed(own, super().content(step, own, at_ns, place))


class F2mdDosDisruptiveSybil(_NewPseudonyms, F2mdDosDisruptive):
    """Replayed messages at twice the own rate, each with a new pseudonym."""

    traits = V2xTraits(
        untrue=("station id", *F2mdDosDisruptive.traits.untrue),
        every_message_matters=True,
        published=Published(veremi_extension=19),
    )

    def __init__(self, context: AttackContext) -> None:
        F2mdDosDisruptive.__init__(self, context, SYBIL_MULTIPLES)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        return self.renamed(own, super().content(step, own, at_ns, place))
