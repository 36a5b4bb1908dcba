"""The GPS attacks on one victim, each applied to the fixes of its schedule."""

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


class FalseFix(NamedTuple):
    """The false fix that a victim receives: position_m (3,) in the map, None for no fix."""

    attack: str
    position_m: Float64 | None


@dataclass
class _ScheduledAttack:
    """One attack, and the start of its current span of attacked fixes."""

    spec: AttackSpec
    bounds: Mapping[str, Range]
    spoofer: Spoofer
    is_active: Acting
    begin_ns: int | None = None
    last_ns: int = 0


class SpoofingSchedule:
    """All attacks on one victim; call `of` for each of its fixes in order.

    Raises AdvpipeError for a bad parameter, a schedule that begins after the recording, and for two attacks
    whose schedules overlap: a receiver reports one place.
    """

    def __init__(self, victim: str, specs: Sequence[AttackSpec], recording: RecordedTimes, seed: int) -> None:
        self.victim = victim
        self.name = "+".join(dict.fromkeys(spec.type for spec in specs))
        self._true_fixes: list[TrueFix] = []
        self._past_nis: list[float] = []
        for one, other in combinations(specs, 2):
            if one.schedule.overlaps(other.schedule):
                raise UsageError(
                    f"{one.type} and {other.type} both spoof {victim} at the same time; give them schedules "
                    "(from_s, to_s) that do not overlap"
                )
        self._attacks = []
        for spec in specs:
            recording.refuse_outside(spec)
            names = ("attack", spec.type, spec.seed_name, victim)
            attack_class = GNSS_ATTACKS.find(spec.type)
            attack = attack_class(**resolved_parameters(spec, attack_class))
            spoofer = attack.begin(named_generator(seed, *names))
            acts = acting_on_fixes(spec, victim, recording.start_ns, seed)
            self._attacks.append(_ScheduledAttack(spec, attack.bounds, spoofer, acts))

    def observe(self, innovation: Innovation) -> None:
        """Remember the innovation of a fix, true or false, in the victim's filter."""
        self._past_nis.append(innovation.nis)

    def of(
        self, time_ns: int, position_m: Float64, heading_rad: float, innovation: Callable[[], Innovation]
    ) -> FalseFix | None:
        """The false fix for a true fix (3,) in the map at a log time; None if no attack is active.

        Raises AdvpipeError for a false fix beyond the bounds that its attack declares.
        """
        self._true_fixes.append(TrueFix(time_ns, position_m))
        false_fix = None
        for attack in self._attacks:
            if not attack.is_active(time_ns):
                attack.begin_ns = None
                continue
            if attack.begin_ns is None:
                attack.begin_ns = attack.last_ns = time_ns
            elapsed_s, interval_s = (time_ns - attack.begin_ns) / 1e9, (time_ns - attack.last_ns) / 1e9
            context = SpoofingContext(
                self._true_fixes, elapsed_s, interval_s, heading_rad, innovation, self._past_nis
            )
            attack.last_ns = time_ns
            false_fix = FalseFix(attack.spec.type, attack.spoofer(context))
            _refuse_beyond(attack, false_fix, position_m)
        return false_fix


def _refuse_beyond(attack: _ScheduledAttack, false_fix: FalseFix, position_m: Float64) -> None:
    if false_fix.position_m is not None:
        change = FixChange(false_fix.position_m - position_m)
        for excess in excesses(change, attack.bounds, FIX_QUANTITIES):
            raise AdvpipeError(f"{false_fix.attack} went beyond its bounds: {excess}")
