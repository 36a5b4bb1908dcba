"""The attacks on one victim, fix by fix, each when its schedule says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.fix_quantities import FIX_QUANTITIES, FixChange
from advpipe.pipeline.labels.quantity import Range, excesses
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.pipeline.scenario.acting import Acting, acting_on_fixes
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.gnss.base import Spoofer, SpoofingContext, TrueFix
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.recording import RecordedTimes


class Lie(NamedTuple):
    """What a victim is made to believe of one fix: position_m (3,) in the map, None for no fix."""

    attack: str
    position_m: Float64 | None


@dataclass
class _Strike:
    """One attack, and since when it has been on."""

    spec: AttackSpec
    bounds: Mapping[str, Range]
    spoofer: Spoofer
    acts: Acting
    begin_ns: int | None = None
    last_ns: int = 0


class SpoofingSchedule:
    """All attacks on one victim; `of` is asked for each of its fixes in order.

    Raises AdvpipeError for a bad parameter, a schedule that begins after the recording, and for two attacks
    whose schedules overlap: a receiver reports one place.
    """

    def __init__(self, victim: str, specs: Sequence[AttackSpec], recording: RecordedTimes, seed: int) -> None:
        self.victim = victim
        self.name = "+".join(dict.fromkeys(spec.type for spec in specs))
        self._genuine: list[TrueFix] = []
        for one, other in combinations(specs, 2):
            if one.schedule.overlaps(other.schedule):
                raise UsageError(
                    f"{one.type} and {other.type} both spoof {victim} at the same time; give them schedules "
                    "(from_s, to_s) that do not overlap"
                )
        self._strikes = []
        for spec in specs:
            recording.refuse_outside(spec)
            names = ("attack", spec.type, spec.seed_name, victim)
            kind = GNSS_ATTACKS.find(spec.type)
            attack = kind(**resolved_parameters(spec, kind))
            spoofer = attack.begin(named_generator(seed, *names))
            acts = acting_on_fixes(spec, victim, recording.start_ns, seed)
            self._strikes.append(_Strike(spec, attack.bounds, spoofer, acts))

    def of(
        self, time_ns: int, position_m: Float64, heading_rad: float, innovation: Callable[[], Innovation]
    ) -> Lie | None:
        """The lie about a genuine fix (3,) in the map at a log time; None where it is left alone.

        Raises AdvpipeError for one that is beyond the bounds that its attack declares.
        """
        self._genuine.append(TrueFix(time_ns, position_m))
        lie = None
        for strike in self._strikes:
            if not strike.acts(time_ns):
                strike.begin_ns = None
                continue
            if strike.begin_ns is None:
                strike.begin_ns = strike.last_ns = time_ns
            since_s, interval_s = (time_ns - strike.begin_ns) / 1e9, (time_ns - strike.last_ns) / 1e9
            context = SpoofingContext(self._genuine, since_s, interval_s, heading_rad, innovation)
            strike.last_ns = time_ns
            lie = Lie(strike.spec.type, strike.spoofer(context))
            _refuse_beyond(strike, lie, position_m)
        return lie


def _refuse_beyond(strike: _Strike, lie: Lie, position_m: Float64) -> None:
    if lie.position_m is not None:
        change = FixChange(lie.position_m - position_m)
        for excess in excesses(change, strike.bounds, FIX_QUANTITIES):
            raise AdvpipeError(f"{lie.attack} went beyond its bounds: {excess}")
