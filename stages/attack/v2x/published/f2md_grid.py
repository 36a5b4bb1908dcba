"""F2MD's grid Sybil: ghost vehicles behind a victim, made of its messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.published.detected_nodes import DetectedNodes
from advpipe.stages.attack.v2x.published.f2md_claims import VARIATION
from advpipe.stages.attack.v2x.published.own_rate import OwnRateFlood, as_own

MULTIPLES = (2, 6)
"""The own message and one or five ghost vehicles: the factor 1 +- 55 % is rounded down to 0 or 1 first."""
GAPS_M = 5.0, 2.0
"""Between boxes, lengthways and sideways; each attacker varies them."""
TURN_DEG, OFF_ROAD_M, NOBODY = 5.0, 2.0, 1
"""What does not fit, a ghost vehicle off the lanes or of a victim that turns, has this pseudonym."""
_USUAL_SIZE_M = 4.5, 1.8


class F2mdGridSybil(OwnRateFlood):
    """Between two own messages, one of each ghost vehicle: in two columns, behind the victim and to its left.

    The victim is the nearest station, as long as it is heard. Places jitter by a tenth of the gap with each
    message. As the code writes the acceleration where the speed belongs, ghost vehicles claim its magnitude
    as their speed.
    """

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim != "generation time"),
        every_message_matters=True,
        published=Published(veremi_extension=16),
    )

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context, MULTIPLES)
        self._nodes = DetectedNodes(context)
        self._gaps_m = {
            attacker: (rng.uniform(*VARIATION, 2) * GAPS_M).tolist() for attacker, rng in self.rngs.items()
        }
        self._victims: dict[int, Sent] = {}
        self._headings_deg: dict[int, float] = {}
        self._ids: dict[tuple[int, int], int] = {}

    def remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        self._nodes.listen(step, sent)

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        attacker = own.station_id
        victim = self._nodes.next_of_victim(attacker, self._victims.get(attacker), own)
        if victim is None:
            return None
        self._victims[attacker] = victim
        tree, own_tree = self.context.cams.open(victim.payload), self.context.cams.open(own.payload)
        heading_rad = None if tree is None else field_of(tree, "heading_rad")
        if tree is None or own_tree is None or heading_rad is None:
            return None
        # Anticlockwise from the east, 0 to 360 degrees.
        angle_deg = (90.0 - math.degrees(heading_rad)) % 360.0
        x_m, y_m = self._place_m(attacker, victim, tree, angle_deg, place + 1)
        fits = self._fits(attacker, angle_deg, (x_m, y_m))
        if fits and place == 0:
            return None
        latitude_deg, longitude_deg, _ = self.context.geodesy.to_geographic([x_m, y_m, 0.0]).tolist()
        rng = self.rngs[attacker]
        acceleration_mps2 = field_of(tree, "longitudinal_acceleration_mps2") or 0.0
        turned_deg = angle_deg + float(rng.uniform(-1, 1)) * angle_deg / 360.0
        pseudonym = self.ghost_id(attacker, place) if fits else NOBODY
        return with_fields(
            as_own(tree, own_tree, at_ns - own.request_ns),
            station_id=pseudonym,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            speed_mps=abs(acceleration_mps2) * (1 + 0.05 * float(rng.uniform(-1, 1))),
            heading_rad=math.radians((90.0 - turned_deg) % 360.0),
        )

    def ghost_id(self, attacker: int, place: int) -> int:
        """The station id of a ghost vehicle, which it keeps."""
        key = attacker, place
        if key not in self._ids:
            self._ids[key] = self.context.pseudonym("ghost", attacker, place)
        return self._ids[key]

    def _place_m(
        self, attacker: int, victim: Sent, tree: CamTree, angle_deg: float, number: int
    ) -> tuple[float, float]:
        """Where a ghost vehicle is: number // 2 rows behind the victim, in its column or one to the left."""
        rng, gaps_m = self.rngs[attacker], self._gaps_m[attacker]
        length_m = field_of(tree, "length_m") or _USUAL_SIZE_M[0]
        width_m = field_of(tree, "width_m") or _USUAL_SIZE_M[1]
        jitter_m = [gap_m / 10 * float(rng.uniform(-1, 1)) for gap_m in gaps_m]
        forward_m = -(number // 2) * (length_m + gaps_m[0]) + jitter_m[0]
        left_m = (number % 2) * (width_m + gaps_m[1]) - jitter_m[1]
        x_m, y_m = self._nodes.place_m(victim)
        cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
        return x_m + cosine * forward_m - sine * left_m, y_m + sine * forward_m + cosine * left_m

    def _fits(self, attacker: int, angle_deg: float, place_m: tuple[float, float]) -> bool:
        """Whether a ghost vehicle is near the middle of a lane, and its victim does not turn; only turns
        clockwise count, as the code compares the difference with its sign."""
        before_deg = self._headings_deg.get(attacker, 0.0)
        self._headings_deg[attacker] = angle_deg
        turn_deg = math.fmod(before_deg - angle_deg, 360.0)
        turn_deg = 360.0 - turn_deg if turn_deg > 180.0 else turn_deg
        roads = self.context.roads()
        is_off = roads is not None and roads.middle_distance_m(place_m) > OFF_ROAD_M
        return turn_deg <= TURN_DEG and not is_off
